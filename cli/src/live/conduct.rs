//! Streaming: tables go to the drives as they come, until all are played or somebody stops them.

use std::sync::mpsc::{Receiver, TryRecvError};

use host_sim::host_node::Order;
use planner::feed::file::FileHeader;
use planner::feed::stream::StreamItem;
use protocol::bus::stop::Stop;

use super::{Stage, failed, fill_ms};
use crate::failure::Failure;
use crate::interrupt;
use crate::json::StreamJson;
use crate::progress::Progress;

/// How long drives may take to come to rest after a stop [ns].
const STOP_NS: u64 = 20_000_000_000;
/// Between two looks at the fill levels [ns].
const LOOK_NS: u64 = 100_000_000;
/// How long the last word is given to reach the bus [ns].
const FAREWELL_NS: u64 = 100_000_000;

/// What comes, and what has come of it.
pub(crate) struct Conductor<'a> {
    pub(crate) header: &'a FileHeader,
    pub(crate) pieces: Receiver<Result<StreamItem, Failure>>,
    /// A piece that was needed before anything could begin.
    pub(crate) first: Option<StreamItem>,
}

impl Conductor<'_> {
    /// Plays everything that comes; Ctrl-C stops on the path, Ctrl-C again as fast as each axis can.
    ///
    /// # Errors
    /// A drive refuses, fails or is silent, the job is not sound, or the bus is gone. The axes come to rest in any case.
    pub(crate) fn play(
        mut self,
        stage: &mut dyn Stage,
        progress: &mut Progress,
    ) -> Result<StreamJson, Failure> {
        let mut told = StreamJson::default();
        let (mut pause_s, mut failure) = (0.0, None);
        let (mut open, mut planned_s) = (true, 0.0f64);
        let (mut presses, mut looked, mut lowest) = (0, 0, u16::MAX);
        progress.stage("streaming");
        loop {
            while open && stage.host().is_hungry() {
                let next = match self.first.take() {
                    Some(item) => Ok(Ok(item)),
                    None if stage.is_virtual() => self.pieces.recv().map_err(|_| TryRecvError::Disconnected),
                    None => self.pieces.try_recv(),
                };
                match next {
                    Ok(Ok(StreamItem::Piece { packed, until_s, .. })) => {
                        let tick_s = f64::from(self.header.tick_ns) * 1e-9;
                        let pause = (std::mem::take(&mut pause_s) / tick_s).ceil() as u64;
                        told.pieces += 1;
                        let longest = packed.axes.iter().map(|axis| axis.controls.len()).max().unwrap_or(0);
                        told.largest_piece_bytes =
                            told.largest_piece_bytes.max((packed.shared.len() + longest) as u64);
                        planned_s = until_s;
                        stage.host().push(Order { packed, pause });
                    }
                    Ok(Ok(StreamItem::Dwell { seconds })) => pause_s += seconds,
                    Ok(Err(error)) => {
                        failure = Some(error);
                        open = false;
                        stage.host().close();
                    }
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => {
                        open = false;
                        stage.host().close();
                    }
                }
            }
            if interrupt::presses() > presses {
                presses += 1;
                told.stopped = true;
                stage.host().stop(if presses == 1 { Stop::Path { tick: None } } else { Stop::Quick });
                return self.come_to_rest(stage, told);
            }
            stage.step()?;
            let now = stage.now();
            if now >= looked + LOOK_NS {
                looked = now;
                let host = stage.host();
                let fill = host.drives().map(fill_ms).min().unwrap_or(0);
                if host.has_more_of_the_motion() {
                    lowest = lowest.min(fill);
                }
                let fills: Vec<String> = host.drives().map(|link| format!("{}", fill_ms(link))).collect();
                progress.note(&format!("playing, {} ms ahead", fills.join("/")));
                let played = planned_s - f64::from(fill) * 1e-3;
                progress.share(if planned_s > 0.0 { (played / planned_s).max(0.0) } else { 0.0 });
            }
            let tick = stage.host().tick_at(now);
            if !open && stage.host().is_finished(tick) {
                break;
            }
        }
        let now = stage.now();
        told.seconds = now as f64 * 1e-9;
        told.motion_s = planned_s;
        told.lowest_fill_ms = (lowest < u16::MAX).then_some(lowest);
        let counters = stage.host().counters();
        (told.resent_frames, told.aborted_starts) = (counters.resent_blocks, counters.aborted_starts);
        told.end = self.positions(stage);
        stage.host().part();
        while stage.now() < now + FAREWELL_NS {
            stage.step()?;
        }
        match failure {
            Some(failure) => Err(failure),
            None => Ok(told),
        }
    }

    /// Waits until all axes stand still.
    fn come_to_rest(&self, stage: &mut dyn Stage, mut told: StreamJson) -> Result<StreamJson, Failure> {
        let (began, mut quick) = (stage.now(), interrupt::presses() > 1);
        // A beat has to come from every drive before its state counts.
        let settled = began + 300_000_000;
        while stage.now() < settled || !stage.host().is_at_rest() {
            if !quick && interrupt::presses() > 1 {
                quick = true;
                stage.host().stop(Stop::Quick);
            }
            stage.step()?;
            if stage.now() > began + STOP_NS {
                let silent = host_sim::host_node::HostError::Silent { axis: 0 };
                return Err(failed(&silent, self.header));
            }
        }
        told.seconds = stage.now() as f64 * 1e-9;
        told.end = self.positions(stage);
        Ok(told)
    }

    /// Where the axes stand, as they have told last [axis unit].
    fn positions(&self, stage: &mut dyn Stage) -> Vec<f64> {
        let axes = &self.header.axes;
        let of = |(link, axis): (&host_sim::host_node::Link, &planner::feed::file::FileAxis)| {
            link.status().map_or(0.0, |status| status.position as f64 / axis.counts_per_unit)
        };
        stage.host().drives().zip(axes).map(of).collect()
    }
}
