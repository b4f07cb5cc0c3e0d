use super::*;

fn file(text: &str) -> tempfile::NamedTempFile {
    let mut file = tempfile::Builder::new().suffix(".csv").tempfile().unwrap();
    std::io::Write::write_all(&mut file, text.as_bytes()).unwrap();
    file
}

fn moves(text: &str) -> Moves {
    read(file(text).path(), Sync::None).unwrap()
}

fn refused(text: &str) -> (String, u32, u32) {
    let failure = read(file(text).path(), Sync::None).unwrap_err();
    assert!(failure.help.is_some(), "{failure}");
    let place = failure.place.map_or((0, 0), |p| (p.line, p.column));
    (failure.message, place.0, place.1)
}

#[test]
fn one_axis_has_no_name() {
    let found = moves(
        "p0,v0,a0,p1,v1,a1,vmax,amax,jmax\n0,0.5,0,10,0,0,5,20,200\n\r\n# a comment\n1,,,,2,,5,20,200\n",
    );
    assert_eq!(found.axes, [""]);
    assert_eq!(found.rows.len(), 2);
    assert_eq!(found.rows[0].axes[0].from, State { position: 0.0, velocity: 0.5, acceleration: 0.0 });
    assert_eq!(found.rows[1].axes[0].to, Target::Velocity(2.0));
    assert_eq!([found.rows[0].line, found.rows[1].line], [2, 5]);
}

#[test]
fn axes_have_the_names_of_their_columns_in_any_order() {
    let text = "sync, jmax_x, p0_x,p1_x,vmax_x,amax_x,p0_7,p1_7,vmax_7,amax_7,jmax_7,vmin_7\n\
                time,200,0,10,5,20,1,2,3,4,5,-1\nphase,200,0,10,5,20,1,2,3,4,5,\n";
    let found = moves(text);
    assert_eq!(found.axes, ["x", "7"]);
    assert_eq!(found.rows[0].sync, Sync::Time);
    assert_eq!(found.rows[0].axes[1].limits.velocity, Bounds { min: -1.0, max: 3.0 });
    assert_eq!(found.rows[1].axes[1].limits.velocity, Bounds { min: -3.0, max: 3.0 });
}

#[test]
fn what_is_wrong_is_placed() {
    let head = "p0,p1,vmax,amax,jmax\n";
    for (text, message, line, column) in [
        (String::new(), "empty", 0, 0),
        (head.to_owned(), "no row", 0, 0),
        ("p0,p1,vmax,amax\n1,2,3,4\n".into(), "`jmax` is missing", 1, 1),
        ("p0_a,p1_a,vmax_a,amax_a,jmax_a,p0\n".into(), "all or none", 1, 6),
        ("p0,p1,vmax,amax,jmax,speed\n".into(), "no column `speed`", 1, 6),
        ("p0,p1,vmax,amax,jmax,p1\n".into(), "`p1` comes twice", 1, 6),
        ("p0,vmax,amax,jmax\n".into(), "`p1` is missing", 1, 1),
        (format!("{head}0,1,2,3\n"), "4 cells, the first line has 5", 2, 5),
        (format!("{head}0,1,2,3,4\n0,1,2,x,4\n"), "`x` is not a number", 3, 4),
        (format!("{head}0,1,2,,4\n"), "amax is missing", 2, 4),
        ("p0,p1,vmax,amax,jmax,sync\n0,1,2,3,4,soon\n".into(), "not `soon`", 2, 6),
    ] {
        let (said, at, cell) = refused(&text);
        assert!(said.contains(message), "{said}: {message}");
        assert_eq!((at, cell), (line, column), "{said}");
    }
}

#[test]
fn other_bytes_are_refused() {
    let mut file = file("p0,p1,vmax,amax,jmax\n");
    std::io::Write::write_all(&mut file, &[0xff, 0xfe, b'\n']).unwrap();
    let failure = read(file.path(), Sync::None).unwrap_err();
    assert!(failure.message.contains("UTF-8"), "{failure}");
}
