//! The two halves of a drive on a board: communication in the main loop, the control tick in an interrupt, and between them
//! two queues with one producer and one consumer each (Lamport 1977). Neither half ever waits for the other: the tick finds
//! an order or it does not, and a table belongs to one half at a time.

use core::sync::atomic::{AtomicU32, Ordering};

use heapless::spsc::{Consumer, Producer, Queue};
use protocol::bus::Frame;
use protocol::bus::sync::{Stamp, nearest};

use crate::drive::{DriveConfig, Station};
use crate::evaluate::Setpoint;
use crate::intake::Orders;
use crate::motion::{Link, Motion};
use crate::orders::{ORDERS, Order, REPORTS, Report};
use crate::update::ImageStore;

/// What lies between the halves; it outlives them.
#[derive(Debug, Default)]
pub struct Between<'a> {
    // One place of a queue stays empty.
    orders: Queue<Order<'a>, { ORDERS + 1 }>,
    reports: Queue<Report<'a>, { REPORTS + 1 }>,
    /// Lowest bits of the tick that is under way.
    tick: AtomicU32,
}

impl<'a> Between<'a> {
    /// Nothing is on its way.
    pub const fn new() -> Self {
        Self { orders: Queue::new(), reports: Queue::new(), tick: AtomicU32::new(0) }
    }

    /// A drive at rest and without torque, with two buffers for tables: the half that talks and the half that moves.
    pub fn drive<'q>(
        &'q mut self,
        config: DriveConfig,
        a: &'a mut [u8],
        b: &'a mut [u8],
    ) -> (Talk<'q, 'a>, Move<'q, 'a>) {
        let (orders, next) = self.orders.split();
        let (reports, heard) = self.reports.split();
        let tick = &self.tick;
        let talk = Talk { station: Station::new(config, a, b), out: Outgoing(orders), heard, tick, now: 0 };
        (talk, Move { motion: Motion::new(config.axis), ends: Ends { next, reports }, tick })
    }
}

/// The half that talks: it belongs to the main loop.
#[allow(missing_debug_implementations, reason = "the ends of a queue have none")]
pub struct Talk<'q, 'a> {
    station: Station<'a>,
    out: Outgoing<'q, 'a>,
    heard: Consumer<'q, Report<'a>>,
    tick: &'q AtomicU32,
    /// The tick that was under way at the last look.
    now: u64,
}

/// The half that moves: it belongs to the control interrupt.
#[allow(missing_debug_implementations, reason = "the ends of a queue have none")]
pub struct Move<'q, 'a> {
    motion: Motion<'a>,
    ends: Ends<'q, 'a>,
    tick: &'q AtomicU32,
}

struct Outgoing<'q, 'a>(Producer<'q, Order<'a>>);

impl<'a> Orders<'a> for Outgoing<'_, 'a> {
    fn has_room(&self) -> bool {
        self.0.ready()
    }

    fn send(&mut self, order: Order<'a>) {
        let _ = self.0.enqueue(order);
    }
}

struct Ends<'q, 'a> {
    next: Consumer<'q, Order<'a>>,
    reports: Producer<'q, Report<'a>>,
}

impl<'a> Link<'a> for Ends<'_, 'a> {
    fn has_orders(&self) -> bool {
        self.next.ready()
    }

    fn next_order(&mut self) -> Option<Order<'a>> {
        self.next.dequeue()
    }

    fn has_room(&self) -> bool {
        self.reports.ready()
    }

    fn report(&mut self, report: Report<'a>) {
        let _ = self.reports.enqueue(report);
    }
}

impl<'a> Talk<'_, 'a> {
    /// With a place for new images.
    pub fn with_images(self, store: &'a mut dyn ImageStore) -> Self {
        Self { station: self.station.with_images(store), ..self }
    }

    /// The drive has to start up anew, with another image, once there is nothing more to transmit.
    pub fn wants_restart(&self) -> bool {
        self.station.wants_restart()
    }

    /// Takes a frame from the bus that has ended so long after the present tick began [ns]; frames of others are ignored.
    pub fn receive(&mut self, frame: &Frame, ns: u32) {
        let at = self.hear(ns);
        self.station.receive(frame, at, &mut self.out);
    }

    /// The next frame to send. Call it all the time: what the motion has to say is heard here.
    pub fn poll_transmit(&mut self) -> Option<Frame> {
        let now = self.hear(0);
        self.station.poll_transmit(now)
    }

    /// A frame that was fetched has left the drive, so long after the present tick began [ns].
    pub fn sent(&mut self, frame: &Frame, ns: u32) {
        let at = self.hear(ns);
        self.station.sent(frame, at);
    }

    /// By how much the next tick is to be shorter [1e-9].
    pub fn trim_ppb(&mut self) -> i32 {
        let now = self.hear(0);
        self.station.clock().trim_ppb(now)
    }

    fn hear(&mut self, ns: u32) -> Stamp {
        self.now = nearest(self.now, self.tick.load(Ordering::Relaxed));
        let at = Stamp { tick: self.now, ns };
        while let Some(report) = self.heard.dequeue() {
            self.station.hear(report, at);
        }
        self.station.retry(&mut self.out);
        at
    }
}

impl<'a> Move<'_, 'a> {
    /// The set-point of this tick; call it once per control tick.
    pub fn tick(&mut self) -> Setpoint {
        self.tick.store(self.motion.now() as u32, Ordering::Relaxed);
        self.motion.tick(&mut self.ends)
    }

    /// The motion itself: for what the board knows of the axis.
    pub fn motion(&mut self) -> &mut Motion<'a> {
        &mut self.motion
    }
}

#[cfg(test)]
mod tests;
