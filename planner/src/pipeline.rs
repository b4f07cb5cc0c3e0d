//! One job from a stream of sections to certified feed tables.
//!
//! The stream (interpreter and geometry) runs in a thread of its own. Sections are planned and certified in parallel,
//! in batches of bounded size, and come out in program order; what comes out does not depend on the number of threads.

use std::sync::mpsc::{Receiver, sync_channel};

use rayon::prelude::*;

use crate::analysis::binding::rulings;
use crate::certificate::{Certificate, certify};
use crate::feed::job::{JobItem, PlannedSection};
use crate::geometry::section::Section;
use crate::geometry::sections::SectionItem;
use crate::job::machine::{AxisLimits, LimitSet, Machine};
use crate::topp::problem::{Binding, JerkForm, Problem, Settings};
use crate::topp::{self, PlanError, Relief};

/// Sections that may wait between the geometry and the planner.
const WAITING: usize = 256;

/// A batch is planned when its geometry spans reach this many, or nothing more is waiting.
const BATCH_SPANS: usize = 4096;

/// A planned job.
#[derive(Clone, Debug, Default)]
pub struct JobPlan {
    /// What the drives do, in order.
    pub items: Vec<JobItem>,
    /// The proof of each section, in order.
    pub certificates: Vec<Certificate>,
    /// What rules each span of each section, in order.
    pub binding: Vec<Vec<Binding>>,
    /// Iterations of the solver, all sections together.
    pub iterations: u64,
    /// What the solver left of the time, all sections together [s]; see [`crate::topp::problem::Plan::gap_s`].
    pub gap_s: f64,
}

impl JobPlan {
    /// The sections, in order.
    pub fn sections(&self) -> impl Iterator<Item = &PlannedSection> {
        self.items.iter().filter_map(|item| match item {
            JobItem::Section(section) => Some(section),
            JobItem::Dwell { .. } | JobItem::Note { .. } => None,
        })
    }
}

/// Why a job cannot be planned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum JobError<E> {
    /// The stream of sections ended with an error.
    #[error(transparent)]
    Section(E),
    /// A section cannot be planned.
    #[error("line {line}: {fault}")]
    Plan {
        /// Line of the program, from 1.
        line: u32,
        /// Why.
        fault: PlanError,
        /// The smallest relaxation of a single limit that would give it a plan, where there is one.
        relief: Option<Relief>,
    },
}

/// Plans and certifies every section that `sections` yields.
///
/// `progress` hears the program line up to which everything is planned.
///
/// # Errors
///
/// The first error in program order; everything planned so far is dropped.
pub fn plan<I, E>(
    sections: I,
    machine: &Machine,
    limits: LimitSet,
    settings: &Settings,
    progress: &mut dyn FnMut(u32),
) -> Result<JobPlan, JobError<E>>
where
    I: Iterator<Item = Result<SectionItem, E>> + Send,
    E: Send,
{
    let (sender, receiver) = sync_channel(WAITING);
    std::thread::scope(|scope| {
        scope.spawn(move || {
            for item in sections {
                let ends = item.is_err();
                // A closed channel means that planning has failed: nobody waits for the rest.
                if sender.send(item).is_err() || ends {
                    break;
                }
            }
        });
        collect(receiver, machine, limits, settings, progress)
    })
}

/// Receives items batch by batch until the stream ends.
fn collect<E>(
    receiver: Receiver<Result<SectionItem, E>>,
    machine: &Machine,
    limits: LimitSet,
    settings: &Settings,
    progress: &mut dyn FnMut(u32),
) -> Result<JobPlan, JobError<E>>
where
    E: Send,
{
    let mut job = JobPlan::default();
    while let Ok(first) = receiver.recv() {
        let (mut batch, mut fault, mut spans) = (Vec::new(), None, 0);
        for item in std::iter::once(first).chain(receiver.try_iter()) {
            match item {
                Ok(item) => {
                    spans += if let SectionItem::Section(s) = &item { s.path.spans() } else { 0 };
                    batch.push(item);
                }
                Err(e) => fault = Some(e),
            }
            if spans >= BATCH_SPANS || fault.is_some() {
                break;
            }
        }
        let planned: Vec<_> =
            batch.into_par_iter().map(|item| plan_item(item, machine, limits, settings)).collect();
        for item in planned {
            match item? {
                Planned::Section { section, certificate, binding, iterations, gap_s } => {
                    if let Some(block) = section.marks.blocks.last() {
                        progress(block.line);
                    }
                    job.items.push(JobItem::Section(section));
                    job.certificates.push(certificate);
                    job.binding.push(binding);
                    job.iterations += iterations;
                    job.gap_s += gap_s;
                }
                Planned::Item(item) => job.items.push(item),
                Planned::Nothing => {}
            }
        }
        if let Some(e) = fault {
            return Err(JobError::Section(e));
        }
    }
    Ok(job)
}

/// One item, planned.
#[allow(clippy::large_enum_variant, reason = "moved once, straight into the job")]
enum Planned {
    Section {
        section: PlannedSection,
        certificate: Certificate,
        binding: Vec<Binding>,
        iterations: u64,
        gap_s: f64,
    },
    Item(JobItem),
    Nothing,
}

fn plan_item<E>(
    item: SectionItem,
    machine: &Machine,
    limits: LimitSet,
    settings: &Settings,
) -> Result<Planned, JobError<E>> {
    match item {
        SectionItem::Section(section) => plan_section(section, machine, limits, settings),
        SectionItem::Dwell { seconds, line } => Ok(Planned::Item(JobItem::Dwell { seconds, line })),
        SectionItem::Note { text, line } => Ok(Planned::Item(JobItem::Note { text, line })),
        // Every section ends at rest, so there is nothing left to do for a stop.
        SectionItem::Stop { .. } => Ok(Planned::Nothing),
    }
}

/// The program line that a fault of a section is about.
pub fn line_of(fault: &PlanError, section: &Section) -> u32 {
    section.marks.line_at(fault.place().unwrap_or(0.0) / section.path.step)
}

fn plan_section<E>(
    section: Section,
    machine: &Machine,
    set: LimitSet,
    settings: &Settings,
) -> Result<Planned, JobError<E>> {
    let limits: Vec<AxisLimits> = machine.axes.iter().map(|axis| set.of(axis, section.kind)).collect();
    let problem = Problem {
        path: &section.path,
        limits: &limits,
        caps: &section.marks.caps,
        control_tick_s: machine.control_tick_s,
    };
    let plan = topp::plan(&problem, settings).map_err(|fault| JobError::Plan {
        line: line_of(&fault, &section),
        fault,
        relief: topp::relief(&problem, settings, &fault),
    })?;
    let Section { kind, marks, .. } = section;
    let certificate = certify(&plan.table, &limits, &marks.caps);
    let section = PlannedSection { kind, limits, table: plan.table, marks };
    // Pseudo-jerk is stricter than the limit that the table is read against: the solver's rows tell.
    let binding = match settings.jerk {
        JerkForm::True => rulings(&section),
        JerkForm::Pseudo => plan.binding,
    };
    let (iterations, gap_s) = (plan.iterations, plan.gap_s);
    Ok(Planned::Section { section, certificate, binding, iterations, gap_s })
}
