//! Axes without a job: jogging, going to a position, going home.

use host_sim::host_node::Link;
use planner::feed::file::FileHeader;
use protocol::bus::stop::Stop;
use protocol::message::{HostMessage, State};

use super::Stage;
use crate::failure::Failure;
use crate::interrupt;
use crate::json::{AxisAtJson, ErrandJson};

/// How long drives may take until they follow set-points [ns].
const READY_NS: u64 = 20_000_000_000;
/// How long a drive may take to show that it has set out [ns].
const SET_OUT_NS: u64 = 500_000_000;
/// How long the last word is given to reach the bus [ns].
const FAREWELL_NS: u64 = 100_000_000;

/// What one axis is to do.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Errand {
    /// To a position [axis unit], no faster than a velocity [axis unit/s].
    To { axis: usize, position: f64, velocity: Option<f64> },
    /// At a velocity [axis unit/s] for a time [s], or until somebody stops it.
    At { axis: usize, velocity: f64, seconds: Option<f64> },
}

impl Errand {
    fn axis(&self) -> usize {
        match *self {
            Errand::To { axis, .. } | Errand::At { axis, .. } => axis,
        }
    }

    fn message(&self, counts: f64) -> HostMessage<'static> {
        match *self {
            Errand::To { position, velocity, .. } => HostMessage::MoveTo {
                position: (position * counts).round() as i64,
                velocity: velocity.map(|v| (v * counts) as f32),
            },
            Errand::At { velocity, .. } => HostMessage::MoveAt { velocity: (velocity * counts) as f32 },
        }
    }

    /// Refuses what no drive of this machine can do.
    ///
    /// # Errors
    /// Names the axis and its limit.
    pub(crate) fn check(&self, header: &FileHeader) -> Result<(), Failure> {
        let Some(axis) = header.axes.get(self.axis()) else {
            return Err(Failure::input("there is no such axis on this machine"));
        };
        let name = &axis.name;
        let most = axis.limits.velocity.max(axis.rapid.velocity);
        let (velocity, place) = match *self {
            Errand::To { position, velocity, .. } => (velocity, Some(position)),
            Errand::At { velocity, .. } => (Some(velocity.abs()), None),
        };
        if let Some(v) = velocity
            && !(v > 0.0 && v <= most)
        {
            return Err(Failure::input(format!("axis {name} cannot go at {v}"))
                .with_help(format!("Its velocities are above 0 and at most {most}.")));
        }
        if let Some(p) = place {
            let [low, high] = axis.travel;
            if !(low..=high).contains(&p) {
                return Err(Failure::input(format!("{p} is outside the travel of axis {name}"))
                    .with_help(format!("It goes from {low} to {high}.")));
            }
        }
        Ok(())
    }
}

/// Lets the axes do their errands, all at once; Ctrl-C brings them to rest.
///
/// # Errors
/// A drive refuses, fails or is silent, or the bus is gone.
pub(crate) fn run(
    stage: &mut dyn Stage,
    header: &FileHeader,
    errands: &[Errand],
) -> Result<ErrandJson, Failure> {
    stage.host().set_tick_ns(header.tick_ns);
    while !stage.host().is_ready() {
        stage.step()?;
        if stage.now() > READY_NS {
            return Err(Failure::input("the drives do not come to follow set-points within 20 s")
                .with_help("`feedspline status` shows how they are."));
        }
    }
    for errand in errands {
        let axis = errand.axis();
        let counts = header.axes.get(axis).map_or(1.0, |a| a.counts_per_unit);
        stage.host().tell(axis, errand.message(counts));
    }
    let began = stage.now();
    let (mut stopped, mut halted) = (false, false);
    let mut at_rest_since = None;
    loop {
        stage.step()?;
        let passed = stage.now() - began;
        let pressed = interrupt::presses();
        if pressed > 0 && !stopped {
            stopped = true;
            stage.host().stop(if pressed > 1 { Stop::Quick } else { Stop::Path { tick: None } });
        }
        for errand in errands {
            if let Errand::At { axis, seconds: Some(seconds), velocity } = errand
                && passed as f64 * 1e-9 >= *seconds
                && *velocity != 0.0
                && !stopped
                && !halted
            {
                halted = true;
                stage.host().tell(*axis, HostMessage::MoveAt { velocity: 0.0 });
            }
        }
        let moves =
            |link: &Link| link.beat().is_some_and(|b| matches!(b.state, State::Moving | State::Stopping));
        let moving = stage.host().drives().any(moves);
        if moving || passed < SET_OUT_NS {
            at_rest_since = None;
        } else if stage.now() - *at_rest_since.get_or_insert(stage.now()) > FAREWELL_NS {
            break;
        }
    }
    if let Some(reason) = stage.host().refusal() {
        return Err(Failure::input(format!("a drive refuses to move: {reason:?}"))
            .with_help("docs/wire-format.md explains every reason."));
    }
    // Positions are asked for, so that they are those of now.
    for axis in 0..header.axes.len() {
        stage.host().tell(axis, HostMessage::Report);
    }
    let asked = stage.now();
    while stage.now() < asked + FAREWELL_NS {
        stage.step()?;
    }
    let axes = stage.host().drives().zip(&header.axes).map(|(link, axis)| AxisAtJson {
        name: axis.name.clone(),
        position: link.status().map_or(0.0, |s| s.position as f64 / axis.counts_per_unit),
    });
    let told = ErrandJson { axes: axes.collect(), seconds: (asked - began) as f64 * 1e-9, stopped };
    if !stopped {
        stage.host().part();
    }
    let now = stage.now();
    while stage.now() < now + FAREWELL_NS {
        stage.step()?;
    }
    Ok(told)
}
