//! Streaming: tables go to the drives as they come, until all are played or somebody stops them.

use std::collections::VecDeque;
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

/// Pieces of a motion that are there before it begins, unless it has fewer: about a second of it.
const HEAD: usize = 4;
/// Pieces that are kept here at most.
const MOST_READY: usize = 8;
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
    /// What has come and was not handed to the host yet.
    pub(crate) ready: VecDeque<StreamItem>,
    /// Nothing more comes.
    ended: bool,
    /// Why, if not because the job has come to its end.
    failure: Option<Failure>,
}

impl<'a> Conductor<'a> {
    /// Plays what comes, after what has come already.
    pub(crate) fn new(
        header: &'a FileHeader,
        pieces: Receiver<Result<StreamItem, Failure>>,
        ready: VecDeque<StreamItem>,
    ) -> Self {
        Self { header, pieces, ready, ended: false, failure: None }
    }

    /// Takes what has come; in virtual time waits for it.
    fn gather(&mut self, stage: &dyn Stage) {
        while !self.ended && self.ready.len() < MOST_READY {
            let next = if stage.is_virtual() {
                if !self.ready.is_empty() {
                    return;
                }
                self.pieces.recv().map_err(|_| TryRecvError::Disconnected)
            } else {
                self.pieces.try_recv()
            };
            match next {
                Ok(Ok(item)) => self.ready.push_back(item),
                Ok(Err(failure)) => (self.failure, self.ended) = (Some(failure), true),
                Err(TryRecvError::Empty) => return,
                Err(TryRecvError::Disconnected) => self.ended = true,
            }
        }
    }

    /// The next item, if it may go to the drives: motion begins when so much of it is there that the rest cannot come late.
    fn next(&mut self, stage: &dyn Stage) -> Option<StreamItem> {
        let begins = self.ready.front().is_some_and(|item| is_piece(item) && !joins(item));
        if begins && !self.ended && !stage.is_virtual() {
            let follow = self.ready.iter().skip(1).take_while(|item| joins(item)).count();
            if follow + 1 < HEAD && follow + 1 == self.ready.len() {
                return None;
            }
        }
        self.ready.pop_front()
    }
}

fn is_piece(item: &StreamItem) -> bool {
    matches!(item, StreamItem::Piece { .. })
}

/// It takes over from the piece before it.
fn joins(item: &StreamItem) -> bool {
    matches!(item, StreamItem::Piece { packed, .. } if packed.header.joint.is_some())
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
        let mut pause_s = 0.0;
        let (mut open, mut planned_s) = (true, 0.0f64);
        let (mut presses, mut looked, mut lowest) = (0, 0, u16::MAX);
        progress.stage("streaming");
        loop {
            while open && stage.host().is_hungry() {
                self.gather(stage);
                match self.next(stage) {
                    Some(StreamItem::Piece { packed, until_s, .. }) => {
                        let tick_s = f64::from(self.header.tick_ns) * 1e-9;
                        let pause = (std::mem::take(&mut pause_s) / tick_s).ceil() as u64;
                        told.pieces += 1;
                        let longest = packed.axes.iter().map(|axis| axis.controls.len()).max().unwrap_or(0);
                        told.largest_piece_bytes =
                            told.largest_piece_bytes.max((packed.shared.len() + longest) as u64);
                        planned_s = until_s;
                        stage.host().push(Order { packed, pause });
                    }
                    Some(StreamItem::Dwell { seconds }) => pause_s += seconds,
                    None if self.ended => {
                        open = false;
                        stage.host().close();
                    }
                    None => break,
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
        match self.failure {
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
