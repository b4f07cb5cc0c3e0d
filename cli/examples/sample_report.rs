//! Writes reports of made-up jobs, to look at: `cargo run -p cli --example sample_report -- DIR`.

#[path = "../tests/suite/sample.rs"]
#[allow(dead_code, reason = "the tests use more of it")]
mod sample;

use std::path::PathBuf;

use sample::Kind;

fn main() -> std::io::Result<()> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "out/sample".into()));
    std::fs::create_dir_all(&folder)?;
    for (name, kind, rounds) in [
        ("space", Kind::Space, 1),
        ("flat", Kind::Flat, 1),
        ("rotary", Kind::Rotary, 1),
        ("slide", Kind::Slide, 1),
        ("long", Kind::Space, 12),
    ] {
        let page = cli::report::page(&sample::report(kind, rounds));
        println!("{name:8} {:>8} bytes", page.len());
        std::fs::write(folder.join(format!("{name}.html")), page)?;
    }
    Ok(())
}
