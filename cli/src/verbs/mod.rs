//! One file per verb.

pub mod bus;
pub mod compare;
pub mod drive;
pub mod errand;
pub mod flash;
pub mod inspect;
pub mod motion;
pub mod plan;
pub mod remote;
pub mod run;
pub mod sample;
pub mod stream;
pub mod update;
pub mod verify;

/// How a verb ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Done, and every limit proven.
    Holds,
    /// Done, but the certificate does not hold.
    Broken,
    /// Done as far as the input allows, and told what it does not.
    Refused,
    /// Brought to rest because somebody has asked for it.
    Stopped,
}

impl Verdict {
    /// The verdict of a certificate.
    pub fn of(holds: bool) -> Self {
        if holds { Verdict::Holds } else { Verdict::Broken }
    }
}
