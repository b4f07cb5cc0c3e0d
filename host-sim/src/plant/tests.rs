use proptest::prelude::*;

use super::*;
use planner::job::machine::TwoMass;

const TICK_S: f64 = 1e-3;

fn plant() -> Plant {
    Plant {
        inertia: 20.0,
        viscous: 0.0,
        coulomb: 0.0,
        effort_limit: 1e4,
        encoder_counts_per_count: 1.0,
        two_mass: None,
    }
}

fn elastic(damping: f64) -> Plant {
    Plant { two_mass: Some(TwoMass { load_share: 0.4, frequency_hz: 35.0, damping }), ..plant() }
}

fn run(model: &mut PlantModel, ticks: u32, effort: f64) {
    for _ in 0..ticks {
        model.advance(effort);
    }
}

#[test]
fn a_free_mass_follows_half_a_t_squared() {
    let mut model = PlantModel::new(&plant(), TICK_S, 0.25).unwrap();
    run(&mut model, 2000, 50.0);
    assert!((model.motor_position() - (0.25 + 0.5 * 2.5 * 4.0)).abs() < 1e-12);
    assert!((model.motor_velocity() - 5.0).abs() < 1e-12);
}

#[test]
fn viscous_friction_decays_exponentially_whatever_its_rate() {
    for viscous in [1e-6, 0.01, 3.0, 4e4] {
        let mut model = PlantModel::new(&Plant { viscous, ..plant() }, TICK_S, 0.0).unwrap();
        run(&mut model, 100, 80.0);
        let (x0, v0) = (model.motor_position(), model.motor_velocity());
        run(&mut model, 500, 0.0);
        let y = viscous / 20.0 * 0.5;
        let v = v0 * (-y).exp();
        let way = v0 * 0.5 * -(-y).exp_m1() / y;
        assert!((model.motor_velocity() - v).abs() <= 1e-11 * v0, "b = {viscous}");
        assert!((model.motor_position() - x0 - way).abs() <= 1e-11 * way, "b = {viscous}");
    }
}

#[test]
fn coulomb_friction_stops_a_sliding_mass_where_its_energy_is_spent() {
    let mut model = PlantModel::new(&Plant { coulomb: 30.0, ..plant() }, TICK_S, 0.0).unwrap();
    run(&mut model, 77, 130.0);
    let (x0, v0) = (model.motor_position(), model.motor_velocity());
    run(&mut model, 2000, 0.0);
    let way = 20.0 * v0 * v0 / (2.0 * 30.0);
    assert_eq!(model.motor_velocity(), 0.0);
    assert!((model.motor_position() - x0 - way).abs() < 1e-12);
}

#[test]
fn halting_inside_a_tick_does_not_depend_on_the_tick() {
    // The same history of effort in ticks of 1 ms and of 1/64 ms ends in the same place.
    let p = Plant { coulomb: 30.0, viscous: 12.0, ..plant() };
    let (mut coarse, mut fine) =
        (PlantModel::new(&p, TICK_S, 0.0).unwrap(), PlantModel::new(&p, TICK_S / 64.0, 0.0).unwrap());
    for k in 0..600u32 {
        let effort = 90.0 * f64::from(k % 97) / 97.0 * if (k / 97) % 2 == 0 { 1.0 } else { -1.0 };
        coarse.advance(effort);
        run(&mut fine, 64, effort);
    }
    assert!((coarse.motor_position() - fine.motor_position()).abs() < 1e-13);
    assert!((coarse.motor_velocity() - fine.motor_velocity()).abs() < 1e-12);
}

#[test]
fn a_mass_sticks_below_coulomb_friction_and_breaks_away_above() {
    for p in [plant(), elastic(0.02)] {
        let mut model = PlantModel::new(&Plant { coulomb: 30.0, ..p }, TICK_S, 1.0).unwrap();
        run(&mut model, 500, 29.9);
        assert_eq!((model.motor_position(), model.motor_velocity()), (1.0, 0.0));
        run(&mut model, 500, 30.3);
        assert!(model.motor_position() > 1.0);
    }
}

#[test]
fn the_coupling_swings_with_its_natural_frequency() {
    // Both masses free: a short push leaves the twist swinging at 35 Hz about zero.
    let mut model = PlantModel::new(&elastic(0.0), 1e-4, 0.0).unwrap();
    run(&mut model, 20, 400.0);
    let twist = |m: &PlantModel| m.motor_position() - m.load_position();
    let (mut crossings, mut last) = (Vec::new(), twist(&model));
    for k in 0..100_000u32 {
        model.advance(0.0);
        let now = twist(&model);
        if last < 0.0 && now >= 0.0 {
            crossings.push((f64::from(k) + last / (last - now)) * 1e-4);
        }
        last = now;
    }
    let periods = (crossings.len() - 1) as f64;
    let hz = periods / (crossings[crossings.len() - 1] - crossings[0]);
    assert!((hz / 35.0 - 1.0).abs() < 1e-6, "{hz}");
}

#[test]
fn damping_ratio_sets_the_decrement() {
    let zeta = 0.05;
    let mut model = PlantModel::new(&elastic(zeta), 1e-4, 0.0).unwrap();
    run(&mut model, 20, 400.0);
    let (mut peaks, mut window) = (Vec::new(), [0.0; 3]);
    for _ in 0..4000 {
        model.advance(0.0);
        window = [window[1], window[2], model.motor_position() - model.load_position()];
        if window[1] > window[0] && window[1] > window[2] && window[1] > 0.0 {
            peaks.push(window[1]);
        }
    }
    let expected = 2.0 * core::f64::consts::PI * zeta / (1.0f64 - zeta * zeta).sqrt();
    for pair in peaks[..5].windows(2) {
        assert!(((pair[0] / pair[1]).ln() / expected - 1.0).abs() < 1e-3);
    }
}

#[test]
fn the_centre_of_mass_knows_nothing_of_the_coupling() {
    let mut pair = PlantModel::new(&elastic(0.03), TICK_S, 0.0).unwrap();
    let mut body = PlantModel::new(&plant(), TICK_S, 0.0).unwrap();
    for k in 0..700u32 {
        let effort = f64::from(k % 50) - 20.0;
        pair.advance(effort);
        body.advance(effort);
    }
    let centre = 0.6 * pair.motor_position() + 0.4 * pair.load_position();
    assert!((centre - body.motor_position()).abs() < 1e-12);
}

#[test]
fn friction_on_the_motor_takes_all_energy_out_of_the_pair() {
    let mut model = PlantModel::new(&Plant { coulomb: 5.0, ..elastic(0.02) }, TICK_S, 0.0).unwrap();
    run(&mut model, 30, 300.0);
    run(&mut model, 8000, 0.0);
    assert_eq!(model.motor_velocity(), 0.0);
    assert!((model.motor_position() - model.load_position()).abs() < 1e-6);
}

#[test]
fn parameters_out_of_range_are_named() {
    let refuse = |p: Plant| match PlantModel::new(&p, TICK_S, 0.0) {
        Err(PlantError::Parameter { parameter, .. }) => parameter,
        other => panic!("accepted: {other:?}"),
    };
    assert_eq!(refuse(Plant { inertia: 0.0, ..plant() }), "inertia");
    assert_eq!(refuse(Plant { coulomb: f64::NAN, ..plant() }), "coulomb");
    assert_eq!(refuse(Plant { effort_limit: f64::INFINITY, ..plant() }), "effort_limit");
    let two_mass = Some(TwoMass { load_share: 1.0, frequency_hz: 35.0, damping: 0.0 });
    assert_eq!(refuse(Plant { two_mass, ..plant() }), "load_share");
    let two_mass = Some(TwoMass { load_share: 0.5, frequency_hz: 1e9, damping: 0.0 });
    assert!(matches!(
        PlantModel::new(&Plant { two_mass, ..plant() }, TICK_S, 0.0),
        Err(PlantError::TooStiff { .. })
    ));
}

proptest! {
    /// Friction never adds energy: kinetic energy gained is at most the work of the effort.
    #[test]
    fn friction_is_passive(
        coulomb in 0.0..100.0f64, viscous in 0.0..500.0f64,
        efforts in proptest::collection::vec(-200.0..200.0f64, 1..60),
    ) {
        let mut model = PlantModel::new(&Plant { coulomb, viscous, ..plant() }, TICK_S, 0.0).unwrap();
        let mut work = 0.0;
        for effort in efforts {
            let before = model.motor_position();
            model.advance(effort);
            work += effort * (model.motor_position() - before);
            let energy = 10.0 * model.motor_velocity().powi(2);
            prop_assert!(energy <= work + 1e-12);
        }
    }
}
