//! Both halves of a drive in one: for hosts, where nothing interrupts anything.

use heapless::Deque;
use protocol::message::{DriveMessage, HostMessage, Identity, Status};

use crate::axis::AxisConfig;
use crate::evaluate::Setpoint;
use crate::intake::{Intake, Orders};
use crate::motion::{Link, Motion};
use crate::orders::{ORDERS, Order, REPORTS, Report};

/// One axis on the level of messages.
#[derive(Debug)]
pub struct Player<'a> {
    intake: Intake<'a>,
    motion: Motion<'a>,
    queues: Queues<'a>,
}

/// What is on its way between the halves.
#[derive(Debug, Default)]
pub(crate) struct Queues<'a> {
    orders: Deque<Order<'a>, ORDERS>,
    reports: Deque<Report<'a>, REPORTS>,
}

impl<'a> Queues<'a> {
    /// The oldest report.
    pub(crate) fn poll_report(&mut self) -> Option<Report<'a>> {
        self.reports.pop_front()
    }
}

impl<'a> Orders<'a> for Queues<'a> {
    fn has_room(&self) -> bool {
        !self.orders.is_full()
    }

    fn send(&mut self, order: Order<'a>) {
        let _ = self.orders.push_back(order);
    }
}

impl<'a> Link<'a> for Queues<'a> {
    fn has_orders(&self) -> bool {
        !self.orders.is_empty()
    }

    fn next_order(&mut self) -> Option<Order<'a>> {
        self.orders.pop_front()
    }

    fn has_room(&self) -> bool {
        !self.reports.is_full()
    }

    fn report(&mut self, report: Report<'a>) {
        let _ = self.reports.push_back(report);
    }
}

impl<'a> Player<'a> {
    /// An axis at rest and without torque, with two buffers for tables.
    pub fn new(config: AxisConfig, a: &'a mut [u8], b: &'a mut [u8]) -> Self {
        Self { intake: Intake::new(config, a, b), motion: Motion::new(config), queues: Queues::default() }
    }

    /// Takes a message; answers wait in [`Player::poll_answer`].
    pub fn handle(&mut self, message: &HostMessage<'_>) {
        self.intake.handle(message, &mut self.queues);
        self.motion.take_orders(&mut self.queues);
        self.exchange();
    }

    /// The set-point of this tick; call it once per control tick.
    pub fn tick(&mut self) -> Setpoint {
        let setpoint = self.motion.tick(&mut self.queues);
        if !self.queues.reports.is_empty() {
            self.exchange();
        }
        setpoint
    }

    /// Tells where the axis really is, after [`Player::tick`]: for the telemetry that follows each status.
    pub fn observe(&mut self, actual: i64) {
        self.motion.observe(actual);
    }

    /// Tells what a tick has cost, in whatever the board counts.
    pub fn observe_cost(&mut self, count: u32) {
        self.motion.observe_cost(count);
    }

    /// The board has found a fault.
    pub fn trip(&mut self, code: u16) {
        self.motion.trip(code);
    }

    /// The oldest answer that was not fetched.
    pub fn poll_answer(&mut self) -> Option<DriveMessage> {
        self.intake.poll_answer()
    }

    /// How the axis is.
    pub fn status(&self) -> Status {
        self.intake.seen(self.motion.status())
    }

    /// Who the axis is.
    pub fn identity(&self) -> Identity {
        self.intake.identity()
    }

    fn exchange(&mut self) {
        while let Some(report) = self.queues.poll_report() {
            self.intake.hear(report);
        }
    }
}

#[cfg(test)]
mod tests;
