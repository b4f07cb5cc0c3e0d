//! The machine file: TOML in, a checked [`Machine`] out.
//!
//! Lengths, speeds and limits are in the axis unit (mm, deg, rad) and seconds. The plant is in SI units whatever
//! the axis unit is: kg, N, N s/m on linear axes; kg m^2, N m, N m s/rad on rotary axes. What the file leaves
//! out is derived, with A the larger of the two acceleration limits, V the larger velocity, both in SI units:
//!
//! | key | default |
//! |---|---|
//! | `name` | the file's name without its ending |
//! | `control_tick_s` | 0.001 |
//! | `corner` | `blend` |
//! | `tolerance_mm`, `best_speed_mm`, `exact_path_mm` | 0.01, 0.05, 0.001 |
//! | `tolerance_rotary` | 0.01 deg, in the unit of the rotary axes |
//! | `override.most`, `override.acceleration`, `override.jerk` | 1, 1.2, 1.3 |
//! | `home`, `second_home` | 0 on every axis not named |
//! | `rapid` | the limits of feed moves |
//! | `mass_kg`, `inertia_kg_m2` | 50, 0.05 |
//! | `coulomb` | 0.05 inertia A |
//! | `viscous` | 0.05 inertia A / V |
//! | `force_limit_n`, `torque_limit_nm` | 1.5 inertia A + coulomb + viscous V |
//! | `encoder_counts_per_unit` | `counts_per_unit` |
//! | `velocity_bandwidth` | 2 pi 50 Hz, at most 0.3 / control tick |
//! | `position_gain` | velocity bandwidth / 4 |
//! | `integral_time_s` | 10 / velocity bandwidth |
//! | `velocity_feed_forward`, `acceleration_feed_forward` | 1 |

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use std::io::Read;
use std::ops::Range;
use std::path::Path;

use serde::Deserialize;
use toml::Spanned;

use super::machine::{
    Axis, AxisKind, AxisLimits, CornerMode, MAX_AXES, Machine, OverrideRule, Plant, Point, Servo, Tool,
    TwoMass, Unit,
};
use super::machine_error::{MachineError, MachineErrorKind as Kind};

/// Largest machine file [bytes].
const FILE_LIMIT_BYTES: u64 = 1 << 20;

/// Largest drive position [counts]: CiA 402 object 6064h is an INTEGER32.
const COUNT_LIMIT: f64 = i32::MAX as f64;

/// Largest magnitude of any value in a machine file: beyond it, products of limits leave the range of f64 that
/// planning keeps exact.
const VALUE_LIMIT: f64 = 1e12;

type Value = Spanned<f64>;
type Checked<T> = Result<T, (Range<usize>, Kind)>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MachineForm {
    name: Option<String>,
    control_tick_s: Option<Value>,
    tolerance_mm: Option<Value>,
    tolerance_rotary: Option<Value>,
    best_speed_mm: Option<Value>,
    exact_path_mm: Option<Value>,
    corner: Option<CornerForm>,
    #[serde(default)]
    axis: Vec<Spanned<AxisForm>>,
    #[serde(default)]
    home: BTreeMap<Spanned<String>, Value>,
    #[serde(default)]
    second_home: BTreeMap<Spanned<String>, Value>,
    #[serde(default)]
    tool: Vec<ToolForm>,
    #[serde(default, rename = "override")]
    override_rule: OverrideForm,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct OverrideForm {
    most: Option<Value>,
    acceleration: Option<Value>,
    jerk: Option<Value>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum CornerForm {
    Blend,
    ExactPath,
    ExactStop,
}

#[derive(Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum KindForm {
    Linear,
    Rotary,
}

#[derive(Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum UnitForm {
    Mm,
    Deg,
    Rad,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AxisForm {
    name: Spanned<String>,
    kind: KindForm,
    unit: Spanned<UnitForm>,
    counts_per_unit: Value,
    travel: Spanned<[f64; 2]>,
    velocity: Value,
    acceleration: Value,
    jerk: Value,
    rapid: Option<LimitsForm>,
    #[serde(default)]
    plant: PlantForm,
    #[serde(default)]
    servo: ServoForm,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LimitsForm {
    velocity: Value,
    acceleration: Value,
    jerk: Value,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlantForm {
    mass_kg: Option<Value>,
    inertia_kg_m2: Option<Value>,
    viscous: Option<Value>,
    coulomb: Option<Value>,
    force_limit_n: Option<Value>,
    torque_limit_nm: Option<Value>,
    encoder_counts_per_unit: Option<Value>,
    two_mass: Option<TwoMassForm>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TwoMassForm {
    load_share: Value,
    frequency_hz: Value,
    damping: Value,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct ServoForm {
    position_gain: Option<Value>,
    velocity_bandwidth: Option<Value>,
    integral_time_s: Option<Value>,
    velocity_feed_forward: Option<Value>,
    acceleration_feed_forward: Option<Value>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ToolForm {
    number: Spanned<u32>,
    length_mm: Value,
}

impl Machine {
    /// Reads and checks a machine file.
    ///
    /// # Errors
    /// If the file cannot be read or anything in it is not as it should be.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, MachineError> {
        let path = path.as_ref();
        let name = path.display().to_string();
        let unreadable =
            |reason: String| MachineError::of_file(&name, Kind::Unreadable { reason: reason.clone() });
        if path.is_dir() {
            return Err(unreadable("it is a directory".into()));
        }
        let file = std::fs::File::open(path).map_err(|e| unreadable(e.to_string()))?;
        let mut text = String::new();
        file.take(FILE_LIMIT_BYTES + 1).read_to_string(&mut text).map_err(|e| unreadable(e.to_string()))?;
        if text.len() as u64 > FILE_LIMIT_BYTES {
            return Err(MachineError::of_file(&name, Kind::TooLarge { limit_bytes: FILE_LIMIT_BYTES }));
        }
        Self::from_toml(&text, &name)
    }

    /// Checks the text of a machine file; `name` is the file's name in messages.
    ///
    /// # Errors
    /// If anything in it is not as it should be.
    pub fn from_toml(text: &str, name: &str) -> Result<Self, MachineError> {
        let form: MachineForm = toml::from_str(text).map_err(|e| {
            let message = e.message().trim().to_owned();
            MachineError::at(name, text, e.span().unwrap_or(0..0), Kind::Toml { message })
        })?;
        form.checked(name).map_err(|(span, kind)| MachineError::at(name, text, span, kind))
    }
}

impl MachineForm {
    fn checked(self, file_name: &str) -> Checked<Machine> {
        let tick_s = match &self.control_tick_s {
            Some(v) => within(v, "control_tick_s", 1e-6, 0.1, "a time from 0.000001 s to 0.1 s")?,
            None => 1e-3,
        };
        match self.axis.len() {
            0 => return Err((0..0, Kind::NoAxes)),
            1..=MAX_AXES => {}
            count => {
                let span = self.axis.get(MAX_AXES).map_or(0..0, Spanned::span);
                return Err((span, Kind::TooManyAxes { count, most: MAX_AXES }));
            }
        }
        let override_rule = self.override_rule.checked()?;
        let mut axes: Vec<Axis> = Vec::with_capacity(self.axis.len());
        for form in &self.axis {
            let axis = form.get_ref().checked(tick_s, override_rule.headroom())?;
            if axes.iter().any(|other| other.name == axis.name) {
                return Err((form.get_ref().name.span(), Kind::AxisTwice { name: axis.name }));
            }
            let other_unit = |a: &Axis| a.kind == AxisKind::Rotary && a.unit != axis.unit;
            if axis.kind == AxisKind::Rotary && axes.iter().any(other_unit) {
                return Err((form.get_ref().unit.span(), Kind::MixedRotaryUnits));
            }
            axes.push(axis);
        }
        let rotary_unit = axes.iter().find(|a| a.kind == AxisKind::Rotary).map(|a| a.unit);
        let rotary_default = if rotary_unit == Some(Unit::Rad) { 0.01 * PI / 180.0 } else { 0.01 };
        let mut tools: Vec<Tool> = Vec::with_capacity(self.tool.len());
        for tool in &self.tool {
            let number = *tool.number.get_ref();
            if tools.iter().any(|t| t.number == number) {
                return Err((tool.number.span(), Kind::ToolTwice { number }));
            }
            let length_mm =
                within(&tool.length_mm, "length_mm", -1e4, 1e4, "a length from -10000 to 10000 mm")?;
            tools.push(Tool { number, length_mm });
        }
        let stem = || Path::new(file_name).file_stem().map(|s| s.to_string_lossy().into_owned());
        Ok(Machine {
            name: self.name.or_else(stem).unwrap_or_else(|| file_name.to_owned()),
            control_tick_s: tick_s,
            tolerance_mm: positive_or(self.tolerance_mm.as_ref(), "tolerance_mm", 0.01)?,
            tolerance_rotary: positive_or(
                self.tolerance_rotary.as_ref(),
                "tolerance_rotary",
                rotary_default,
            )?,
            best_speed_mm: positive_or(self.best_speed_mm.as_ref(), "best_speed_mm", 0.05)?,
            exact_path_mm: positive_or(self.exact_path_mm.as_ref(), "exact_path_mm", 0.001)?,
            corner: match self.corner.unwrap_or(CornerForm::Blend) {
                CornerForm::Blend => CornerMode::Blend,
                CornerForm::ExactPath => CornerMode::ExactPath,
                CornerForm::ExactStop => CornerMode::ExactStop,
            },
            home: stored_position(&self.home, "home", &axes)?,
            second_home: stored_position(&self.second_home, "second_home", &axes)?,
            axes,
            tools,
            override_rule,
        })
    }
}

impl AxisForm {
    fn checked(&self, tick_s: f64, headroom: [f64; 3]) -> Checked<Axis> {
        let name = self.name.get_ref().to_ascii_uppercase();
        let tail_ok = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        let usable = name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(tail_ok);
        if !usable || name.len() > 16 {
            return Err((self.name.span(), Kind::AxisName { name: self.name.get_ref().clone() }));
        }
        let kind = match self.kind {
            KindForm::Linear => AxisKind::Linear,
            KindForm::Rotary => AxisKind::Rotary,
        };
        let (unit, unit_name) = match self.unit.get_ref() {
            UnitForm::Mm => (Unit::Mm, "mm"),
            UnitForm::Deg => (Unit::Deg, "deg"),
            UnitForm::Rad => (Unit::Rad, "rad"),
        };
        if (kind == AxisKind::Linear) != (unit == Unit::Mm) {
            return Err((self.unit.span(), Kind::UnitOfKind { kind: kind_name(kind), unit: unit_name }));
        }
        let counts_per_unit = positive(&self.counts_per_unit, "counts_per_unit")?;
        let travel @ [min, max] = *self.travel.get_ref();
        if !(min.is_finite() && max.is_finite() && min < max) {
            return Err((self.travel.span(), Kind::TravelOrder { min, max }));
        }
        if min > 0.0 || max < 0.0 {
            return Err((self.travel.span(), Kind::TravelWithoutZero { min, max }));
        }
        let counts = max.max(-min) * counts_per_unit;
        if counts > COUNT_LIMIT {
            return Err((self.travel.span(), Kind::TooManyCounts { counts }));
        }
        let limits = limits(&self.velocity, &self.acceleration, &self.jerk)?;
        let rapid = match &self.rapid {
            Some(r) => self::limits(&r.velocity, &r.acceleration, &r.jerk)?,
            None => limits,
        };
        let si_per_unit = match unit {
            Unit::Mm => 1e-3,
            Unit::Deg => PI / 180.0,
            Unit::Rad => 1.0,
        };
        let fastest = AxisLimits {
            velocity: limits.velocity.max(rapid.velocity) * si_per_unit,
            acceleration: limits.acceleration.max(rapid.acceleration) * si_per_unit,
            jerk: limits.jerk.max(rapid.jerk) * si_per_unit,
        };
        let plant = self.plant.checked(kind, counts_per_unit, &fastest)?;
        let servo = self.servo.checked(tick_s)?;
        Ok(Axis { name, kind, unit, counts_per_unit, travel, limits, rapid, headroom, plant, servo })
    }
}

impl OverrideForm {
    fn checked(&self) -> Checked<OverrideRule> {
        let usual = OverrideRule::default();
        let factor = |value: &Option<Value>, key, default, most, expected| match value {
            Some(v) => within(v, key, 1.0, most, expected),
            None => Ok(default),
        };
        let few = "a factor from 1 to 4";
        Ok(OverrideRule {
            most: factor(&self.most, "override.most", usual.most, 1.5, "a rate from 1 to 1.5")?,
            acceleration: factor(&self.acceleration, "override.acceleration", usual.acceleration, 4.0, few)?,
            jerk: factor(&self.jerk, "override.jerk", usual.jerk, 4.0, few)?,
        })
    }
}

impl PlantForm {
    /// Fills in what the file leaves out; `fastest` holds the axis limits in SI units.
    fn checked(&self, kind: AxisKind, counts_per_unit: f64, fastest: &AxisLimits) -> Checked<Plant> {
        let (inertia, effort) = match kind {
            AxisKind::Linear => {
                refuse(&self.inertia_kg_m2, "inertia_kg_m2", kind, "mass_kg")?;
                refuse(&self.torque_limit_nm, "torque_limit_nm", kind, "force_limit_n")?;
                (positive_or(self.mass_kg.as_ref(), "mass_kg", 50.0)?, (&self.force_limit_n, "force_limit_n"))
            }
            AxisKind::Rotary => {
                refuse(&self.mass_kg, "mass_kg", kind, "inertia_kg_m2")?;
                refuse(&self.force_limit_n, "force_limit_n", kind, "torque_limit_nm")?;
                let inertia = positive_or(self.inertia_kg_m2.as_ref(), "inertia_kg_m2", 0.05)?;
                (inertia, (&self.torque_limit_nm, "torque_limit_nm"))
            }
        };
        let push = inertia * fastest.acceleration;
        let coulomb = not_negative_or(self.coulomb.as_ref(), "coulomb", 0.05 * push)?;
        let viscous = not_negative_or(self.viscous.as_ref(), "viscous", 0.05 * push / fastest.velocity)?;
        let enough = 1.5 * push + coulomb + viscous * fastest.velocity;
        let encoder =
            positive_or(self.encoder_counts_per_unit.as_ref(), "encoder_counts_per_unit", counts_per_unit)?;
        let two_mass = match &self.two_mass {
            None => None,
            Some(t) => Some(TwoMass {
                load_share: within(&t.load_share, "load_share", 1e-3, 0.999, "a share from 0.001 to 0.999")?,
                frequency_hz: positive(&t.frequency_hz, "frequency_hz")?,
                damping: within(&t.damping, "damping", 0.0, 1.0, "a ratio from 0 to 1")?,
            }),
        };
        Ok(Plant {
            inertia,
            viscous,
            coulomb,
            effort_limit: positive_or(effort.0.as_ref(), effort.1, enough)?,
            encoder_counts_per_count: encoder / counts_per_unit,
            two_mass,
        })
    }
}

impl ServoForm {
    fn checked(&self, tick_s: f64) -> Checked<Servo> {
        // Beyond 0.3 / tick, the delay of sampling and computing takes more than 25 degrees of phase.
        let bandwidth = (TAU * 50.0).min(0.3 / tick_s);
        let velocity_bandwidth =
            positive_or(self.velocity_bandwidth.as_ref(), "velocity_bandwidth", bandwidth)?;
        let share = |value: &Option<Value>, key| match value {
            Some(v) => within(v, key, 0.0, 1.0, "a share from 0 to 1"),
            None => Ok(1.0),
        };
        Ok(Servo {
            position_gain: positive_or(
                self.position_gain.as_ref(),
                "position_gain",
                velocity_bandwidth / 4.0,
            )?,
            velocity_bandwidth,
            integral_time_s: positive_or(
                self.integral_time_s.as_ref(),
                "integral_time_s",
                10.0 / velocity_bandwidth,
            )?,
            velocity_feed_forward: share(&self.velocity_feed_forward, "velocity_feed_forward")?,
            acceleration_feed_forward: share(&self.acceleration_feed_forward, "acceleration_feed_forward")?,
        })
    }
}

fn kind_name(kind: AxisKind) -> &'static str {
    match kind {
        AxisKind::Linear => "linear",
        AxisKind::Rotary => "rotary",
    }
}

fn limits(velocity: &Value, acceleration: &Value, jerk: &Value) -> Checked<AxisLimits> {
    Ok(AxisLimits {
        velocity: positive(velocity, "velocity")?,
        acceleration: positive(acceleration, "acceleration")?,
        jerk: positive(jerk, "jerk")?,
    })
}

fn stored_position(
    form: &BTreeMap<Spanned<String>, Value>,
    key: &'static str,
    axes: &[Axis],
) -> Checked<Point> {
    let mut point = [0.0; MAX_AXES];
    for (name, value) in form {
        let wanted = name.get_ref().to_ascii_uppercase();
        let Some((slot, axis)) = point.iter_mut().zip(axes).find(|(_, axis)| axis.name == wanted) else {
            return Err((name.span(), Kind::AxisUnknown { key, name: name.get_ref().clone() }));
        };
        let (v, [min, max]) = (*value.get_ref(), axis.travel);
        if !(min <= v && v <= max) {
            return Err((value.span(), Kind::OutsideTravel { key, axis: wanted, value: v, min, max }));
        }
        *slot = v;
    }
    Ok(point)
}

fn refuse(value: &Option<Value>, key: &'static str, kind: AxisKind, instead: &'static str) -> Checked<()> {
    match value {
        Some(v) => Err((v.span(), Kind::KeyOfKind { key, kind: kind_name(kind), instead })),
        None => Ok(()),
    }
}

fn within(v: &Value, key: &'static str, min: f64, max: f64, expected: &'static str) -> Checked<f64> {
    let value = *v.get_ref();
    if min <= value && value <= max {
        Ok(value)
    } else {
        Err((v.span(), Kind::OutOfRange { key, value, expected }))
    }
}

fn positive(v: &Value, key: &'static str) -> Checked<f64> {
    within(v, key, 1.0 / VALUE_LIMIT, VALUE_LIMIT, "a number greater than 0 and at most 1e12")
}

fn positive_or(v: Option<&Value>, key: &'static str, default: f64) -> Checked<f64> {
    v.map_or(Ok(default), |v| positive(v, key))
}

fn not_negative_or(v: Option<&Value>, key: &'static str, default: f64) -> Checked<f64> {
    v.map_or(Ok(default), |v| within(v, key, 0.0, VALUE_LIMIT, "a number from 0 to 1e12"))
}

#[cfg(test)]
mod tests;
