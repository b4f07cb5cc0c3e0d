use super::*;
use clap::CommandFactory;

fn plan(words: &[&str]) -> Result<PlanArgs, clap::Error> {
    let words = ["feedspline", "plan"].iter().chain(words);
    match Cli::try_parse_from(words)?.verb {
        Verb::Plan(args) => Ok(args),
        other => panic!("{other:?}"),
    }
}

#[test]
fn command_line_is_consistent() {
    Cli::command().debug_assert();
}

#[test]
fn every_verb_shows_an_example_of_itself() {
    for verb in Cli::command().get_subcommands_mut() {
        let example = format!("Example: feedspline {} ", verb.get_name());
        assert!(verb.render_help().to_string().contains(&example), "{example}");
    }
}

#[test]
fn defaults_are_jerk_limited_rs274() {
    let args = plan(&["a.ngc"]).unwrap();
    assert_eq!((args.jerk_form().unwrap(), args.windows), (Jerk::True, Windows::Overlap));
    assert_eq!((args.job.dialect.unwrap_or_default(), args.solver), (Dialect::Rs274, Solver::InteriorPoint));
    let job = args.job;
    assert!(job.machine.is_none() && job.out.is_none() && job.tolerance.is_none() && !job.ignore_feed);
    assert!(job.spline.is_none() && job.knots.is_none() && job.feed.is_none());
}

#[test]
fn every_option_is_read() {
    let words = "a.ngc --machine m.toml -o d --tolerance 0.02 --ignore-feed --limits va --dialect printer \
                 --solver clarabel --windows zhao --threads 3 --json --quiet";
    let args = plan(&words.split_whitespace().collect::<Vec<_>>()).unwrap();
    assert_eq!(args.job.machine, Some("m.toml".into()));
    assert_eq!(args.job.out, Some("d".into()));
    assert_eq!(args.job.tolerance, Some(0.02));
    assert_eq!(
        (args.limits, args.job.dialect, args.solver),
        (Some(Limits::Va), Some(Dialect::Printer), Solver::Clarabel)
    );
    assert_eq!((args.job.threads, args.windows), (Some(3), Windows::Zhao));
    assert!(args.job.ignore_feed && args.speech.json && args.speech.quiet);
    let words = "a.csv --spline periodic --knots uniform --feed 1200 --jerk pseudo";
    let args = plan(&words.split_whitespace().collect::<Vec<_>>()).unwrap();
    assert_eq!(
        (args.job.spline, args.job.knots, args.job.feed, args.jerk),
        (Some(Ends::Periodic), Some(Knots::Uniform), Some(1200.0), Some(Jerk::Pseudo))
    );
}

#[test]
fn tolerances_that_are_no_length_are_refused() {
    for bad in ["-0.1", "nan", "inf", "wide", ""] {
        assert!(plan(&["a.ngc", &format!("--tolerance={bad}")]).is_err(), "{bad}");
    }
    assert_eq!(plan(&["a.ngc", "--tolerance", "0"]).unwrap().job.tolerance, Some(0.0));
}

#[test]
fn feeds_that_are_no_speed_are_refused() {
    for bad in ["0", "-5", "nan", "inf", "fast", "", "1e300", "1e-300"] {
        assert!(plan(&["a.csv", &format!("--feed={bad}")]).is_err(), "{bad}");
    }
    assert!(plan(&["a.csv", "--feed=0.01"]).is_ok());
}

#[test]
fn trace_every_starts_at_one() {
    let run = |n: &str| Cli::try_parse_from(["feedspline", "run", "a.ngc", "--trace-every", n]);
    assert!(run("1").is_ok());
    assert!(run("0").is_err());
}

#[test]
fn limits_and_jerk_agree_or_are_refused() {
    let form = |words: &[&str]| plan(&[&["a.ngc"], words].concat()).unwrap().jerk_form();
    assert_eq!(form(&["--limits", "va"]).unwrap(), Jerk::None);
    assert_eq!(form(&["--limits", "va", "--jerk", "none"]).unwrap(), Jerk::None);
    assert_eq!(form(&["--jerk", "none"]).unwrap(), Jerk::None);
    assert_eq!(form(&["--limits", "vaj", "--jerk", "pseudo"]).unwrap(), Jerk::Pseudo);
    for words in [["--limits", "va", "--jerk", "true"], ["--limits", "vaj", "--jerk", "none"]] {
        assert!(form(&words).unwrap_err().message.contains("--jerk"), "{words:?}");
    }
}

#[test]
fn options_of_the_other_kind_of_job_are_refused() {
    let check = |words: &[&str]| plan(words).unwrap().job.check().map_err(|e| e.message);
    for (option, value) in [("--spline", "natural"), ("--knots", "chord"), ("--feed", "100")] {
        assert!(check(&["a.csv", option, value]).is_ok(), "{option}");
        assert!(check(&["a.CSV", option, value]).is_ok(), "{option}");
        assert!(check(&["a.ngc", option, value]).unwrap_err().contains(option), "{option}");
        assert!(check(&["csv", option, value]).is_err(), "{option}");
    }
    for words in [&["--dialect", "rs274"][..], &["--ignore-feed"]] {
        assert!(check(&[&["a.ngc"], words].concat()).is_ok(), "{words:?}");
        assert!(check(&[&["a.csv"], words].concat()).unwrap_err().contains(words[0]), "{words:?}");
    }
}
