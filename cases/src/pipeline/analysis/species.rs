//! One group of grains in the field.

use std::f64::consts::TAU;

use field::analysis::{Effective, Expansion, Opening, Space, Tones, Well, voltages, well};
use field::{DrivenField, Samples};
use meshes::Vec3;
use nalgebra::Matrix3;
use tracer::secular::{Equilibrium, Mathieu, Mode, Neighbourhood, common_period, effective, traced};
use tracer::spectrum::Measured;
use tracer::{Grain, System};

use super::report::{
    Compensation, Depth, MathieuReport, Micromotion, ModeReport, Offset, Point, SecularReport, Species,
};
use super::{CriticalPoint, Failure, Ground, Jet, Kind, Reporter, critical_points_on, first_wall, polish, values_on};
use crate::case::{Case, Drive, GROUND, GrainGroup};
use crate::pipeline::flights;
use crate::pipeline::solution::Solution;

/// Elementary charge, C.
const E: f64 = 1.602_176_634e-19;

/// Amplitude of the grain that is traced, of the distance of the nearest electrode: multipoles beyond the quadrupole then change
/// frequencies by some 1e-6.
const SMALL: f64 = 1e-3;

/// Analyses a group; gives its effective potential with the report, J/kg.
pub(super) fn species(
    ground: &Ground,
    group: &GrainGroup,
    reporter: &dyn Reporter,
) -> Result<(Species, Effective), Failure> {
    let (case, space) = (ground.case, &ground.space);
    let specific = group.charge / group.mass;
    let region = tracer::Region { min: ground.bounds.min, max: ground.bounds.max };
    let system = alone(case, ground.driven.field.clone(), region);
    let rate = system.drag_rate(group.mass, group.radius).unwrap_or(0.0);
    let acceleration = case.forces.gravity + case.forces.constant / group.mass;
    let potential = effective(&ground.tones, specific, rate, acceleration);
    // 1. Minima and saddles.
    let values = values_on(space, &potential, &ground.lattice);
    let found = critical_points_on(space, &potential, &ground.lattice, &values);
    let middle = (ground.bounds.min + ground.bounds.max) * 0.5;
    let minima: Vec<&CriticalPoint> = found.iter().filter(|c| c.kind == Kind::Minimum).collect();
    let distance = |c: &CriticalPoint| (c.position - middle).norm();
    let minimum = minima.iter().copied().min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let (center, center_is) = match minimum {
        Some(point) => (point.position, "the minimum of the effective potential nearest to the middle".to_owned()),
        None => ground.fallback.clone(),
    };
    if space.room(&center) <= 0.0 {
        let empty = Species::nothing(group, rate, center, center_is);
        reporter.warning(&format!("grains {}: no null and no minimum was found to analyse", group.name));
        return Ok((empty, potential));
    }
    let expansion = Expansion::near(space.field, center, space.room(&center));
    let here = potential.local(&expansion, &center);
    // Above the centre, per charge; without charge nothing is in volts.
    let volts = |value: f64| if specific == 0.0 { 0.0 } else { (value - here.value) / specific };
    let points = found.iter().map(|point| Point {
        position: point.position.into(),
        kind: point.kind.name(),
        volts: volts(point.value),
        curvatures: point.curvatures,
        axes: point.axes.map(Into::into),
        one_of_many: point.flat,
        error_estimate: point.position_error,
    });
    let mut report = Species::nothing(group, rate, center, center_is);
    report.effective = points.collect();
    // 2. Mathieu's parameters on the principal axes.
    let frequency = ground.tones.strongest();
    let principal = principal(&here.hessian);
    if let Some(frequency) = frequency {
        let mathieu = mathieu(&ground.tones, space.error, &expansion, &center, principal.1, specific, rate, frequency);
        report.adiabaticity = Some(mathieu.q.iter().fold(0.0, |m: f64, q| m.max(q.abs())));
        report.mathieu = Some(mathieu);
    }
    // 3. The motion about the equilibrium.
    let frequencies: Vec<f64> = ground.tones.tones.iter().map(|t| t.frequency).collect();
    let period = common_period(&frequencies);
    if ground.motion && specific != 0.0 && (period.is_some() || frequencies.is_empty()) {
        let near = Neighbourhood {
            expansion: &expansion,
            waveforms: ground.driven.field.waveforms(),
            specific_charge: specific,
            rate,
            acceleration,
            magnetic_field: case.forces.magnetic_field,
            period,
        };
        match near.equilibrium(&center) {
            Some(equilibrium) => {
                let secular = secular(ground, group, &system, &equilibrium, &principal, &report, period)?;
                report.micromotion = report.mathieu.as_ref().map(|mathieu| Micromotion {
                    at_equilibrium: minimum.map(|_| equilibrium.excursion),
                    per_distance: mathieu.q.map(|q| 0.5 * q.abs()),
                });
                if !secular.modes.iter().all(|mode| mode.agree) {
                    reporter.warning(&format!(
                        "grains {}: the ways to the secular frequencies do not agree within their errors",
                        group.name
                    ));
                }
                report.secular_hz = Some(secular);
            }
            None => reporter.warning(&format!(
                "grains {}: no periodic orbit was found next to the centre, and so no secular frequencies",
                group.name
            )),
        }
    }
    // 4. How deep it is, and what forces do.
    if let Some(minimum) = minimum {
        let others: Vec<Vec3> = minima
            .iter()
            .filter(|m| !(std::ptr::eq(**m, minimum) || m.flat && minimum.flat))
            .map(|m| m.position)
            .collect();
        let exact = &ground.driven.exact;
        let walls = |a: &Vec3, b: &Vec3| first_wall(exact, case.field.ground.as_ref(), case.electrodes.len(), a, b);
        let floor = (&minimum.position, minimum.value);
        let found = well(space, &potential, (&ground.lattice, &values), floor, &others, &walls);
        report.depth_ev = found.map(|well| {
            let (solution, electrodes) = (ground.solution, case.electrodes.len());
            depth(ground, group, &on_surface(space, solution, electrodes, &potential, minimum.value, well))
        });
        report.offset = Some(offset(ground, group, &potential, minimum, acceleration));
    }
    Ok((report, potential))
}

impl Species {
    fn nothing(group: &GrainGroup, drag_rate: f64, center: Vec3, center_is: String) -> Self {
        Self {
            name: group.name.clone(),
            charge: group.charge,
            mass: group.mass,
            drag_rate,
            center: center.into(),
            center_is,
            effective: Vec::new(),
            mathieu: None,
            secular_hz: None,
            depth_ev: None,
            adiabaticity: None,
            micromotion: None,
            offset: None,
        }
    }
}

/// What a grain alone and without noise flies through.
pub(crate) fn alone(case: &Case, field: DrivenField, region: tracer::Region) -> System {
    let whole = flights::system(case, field.clone(), None, None, region);
    let mut alone = System::new().with_field(field);
    if case.forces.gravity != Vec3::zeros() {
        alone = alone.with_gravity(case.forces.gravity);
    }
    if case.forces.constant != Vec3::zeros() {
        alone = alone.with_constant_force(case.forces.constant);
    }
    alone.drag = whole.drag;
    alone.with_magnetic_field(case.forces.magnetic_field)
}

/// Curvatures, largest first, with their axes.
pub(super) fn principal(hessian: &Matrix3<f64>) -> ([f64; 3], [Vec3; 3]) {
    let eigen = hessian.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let axis = |k: usize| {
        let axis: Vec3 = eigen.eigenvectors.column(k).into();
        if axis[axis.iamax()] < 0.0 { -axis } else { axis }
    };
    (order.map(|k| eigen.eigenvalues[k]), order.map(axis))
}

/// Matrices of a, and of q with the cosine and the sine of a frequency (Hz).
pub(crate) fn bends(tones: &Tones, jets: &[Jet], specific: f64, frequency: f64) -> [Matrix3<f64>; 3] {
    let omega = TAU * frequency;
    let scale = 4.0 * specific / (omega * omega);
    let bend = |weights: &[f64]| Jet::sum(jets, weights).hessian;
    let tone = tones.tones.iter().find(|t| t.frequency == frequency);
    let [cosine, sine] =
        tone.map_or([Matrix3::zeros(); 2], |t| [bend(&t.cosine) * (-0.5 * scale), bend(&t.sine) * (-0.5 * scale)]);
    [bend(&tones.constant) * scale, cosine, sine]
}

/// a and q on three axes.
pub(crate) fn parameters([statics, cosine, sine]: &[Matrix3<f64>; 3], axes: &[Vec3; 3]) -> ([f64; 3], [f64; 3]) {
    let along = |m: &Matrix3<f64>, axis: &Vec3| axis.dot(&(m * axis));
    let q = |axis: &Vec3| {
        let (c, s) = (along(cosine, axis), along(sine, axis));
        // The larger part gives the sign.
        c.hypot(s).copysign(if c.abs() >= s.abs() { c } else { s })
    };
    ([0, 1, 2].map(|k| along(statics, &axes[k])), [0, 1, 2].map(|k| q(&axes[k])))
}

#[allow(clippy::too_many_arguments)]
pub(super) fn mathieu(
    tones: &Tones,
    field_error: f64,
    expansion: &Expansion,
    center: &Vec3,
    axes: [Vec3; 3],
    specific: f64,
    rate: f64,
    frequency: f64,
) -> MathieuReport {
    let jets = expansion.jets(center);
    let omega = TAU * frequency;
    let scale = 4.0 * specific / (omega * omega);
    let tone = tones.tones.iter().find(|t| t.frequency == frequency);
    let bends = bends(tones, &jets, specific, frequency);
    let [statics, cosine, sine] = bends;
    let along = |m: &Matrix3<f64>, i: usize, j: usize| axes[i].dot(&(m * axes[j]));
    let (a, q) = parameters(&bends, &axes);
    let k = rate / omega;
    let pairs = [(0, 1), (0, 2), (1, 2)];
    let coupling =
        pairs.iter().flat_map(|&(i, j)| [&statics, &cosine, &sine].map(|m| along(m, i, j).abs())).fold(0.0, f64::max);
    let each = [0, 1, 2].map(|i| Mathieu { a: a[i], q: q[i], k });
    let finite = |x: f64| x.is_finite().then_some(x);
    // What each channel's error does, at its own voltage.
    let size = |weights: &[f64]| jets.iter().zip(weights).map(|(j, w)| (j.hessian.norm() * w).abs()).sum::<f64>();
    let rf = tone.map_or(0.0, |t| size(&t.cosine).hypot(size(&t.sine)));
    let error = field_error * scale.abs() * size(&tones.constant).max(0.5 * rf);
    MathieuReport {
        axes: axes.map(Into::into),
        a,
        q,
        k,
        coupling,
        beta: each.map(|m| m.beta()),
        beta_small_q: each.map(|m| m.small_q_beta()),
        q_limits: each.map(|m| m.limits().map(|[low, high]| [finite(low), finite(high)])),
        stable: each.map(|m| m.is_stable()),
        error_estimate: error,
    }
}

/// The modes of the motion in the order of the principal axes.
pub(crate) fn in_order(modes: &[Mode], axes: &[Vec3; 3]) -> Vec<Mode> {
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let overlap = |order: &[usize; 3]| -> f64 {
        order.iter().zip(axes).map(|(k, axis)| modes.get(*k).map_or(0.0, |mode| mode.axis.dot(axis).powi(2))).sum()
    };
    // The first of equals, with more weight than rounding.
    let mut best = orders[0];
    for order in orders {
        if overlap(&order) > overlap(&best) + 1e-6 {
            best = order;
        }
    }
    best.iter().filter_map(|k| modes.get(*k).copied()).collect()
}

fn secular(
    ground: &Ground,
    group: &GrainGroup,
    system: &System,
    equilibrium: &Equilibrium,
    (curvatures, axes): &([f64; 3], [Vec3; 3]),
    report: &Species,
    period: Option<f64>,
) -> Result<SecularReport, Failure> {
    let room = ground.space.room(&equilibrium.position);
    let grain = Grain {
        position: equilibrium.position,
        velocity: equilibrium.velocity,
        charge: group.charge,
        mass: group.mass,
        radius: group.radius,
        id: 1,
        group: 0,
    };
    let lines = traced(system, &grain, equilibrium, axes, SMALL * room, period).map_err(|error| {
        Failure::run(format!("a grain near the centre cannot be traced: {error}"), "look at the voltages")
    })?;
    let magnetic = ground.case.forces.magnetic_field != Vec3::zeros();
    let field = ground.space.error;
    let mut modes = Vec::new();
    for (k, mode) in in_order(&equilibrium.modes, axes).iter().enumerate() {
        let error = mode.frequency_error + field * mode.frequency;
        let per_beta = report.mathieu.as_ref().zip(period).map(|(m, period)| (m, 0.5 / period));
        let mathieu = per_beta.and_then(|(m, f)| m.beta[k].map(|beta| beta * f)).filter(|_| !magnetic);
        let square = curvatures[k] - 0.25 * report.drag_rate.powi(2);
        let small_q = (square >= 0.0 && !magnetic).then(|| square.sqrt() / TAU);
        let small_q_error = small_q.map(|f| match mathieu {
            // What the formula leaves out at this a and q, and what coupling of the axes adds.
            Some(exact) => (f - exact).abs() + field * f + report.mathieu.as_ref().map_or(0.0, |m| m.coupling) * f,
            None if period.is_none() => 1e-9 * f + field * f,
            None => f,
        });
        let spectrum = nearest_line(&lines, mode.frequency);
        // Amplitudes of a thousandth of the room: squares of that.
        let spectrum_error = spectrum.map(|line| line.error + 10.0 * SMALL * SMALL * line.frequency);
        let same = |other: Option<f64>, by: Option<f64>| match (other, by) {
            (Some(other), Some(by)) => (other - mode.frequency).abs() <= by + error,
            _ => true,
        };
        // Of two modes alike any direction between is an axis: then those of the potential.
        let alike = |other: &Mode| (other.frequency - mode.frequency).abs() <= 1e-6 * mode.frequency;
        let many = equilibrium.modes.iter().filter(|other| alike(other)).count() > 1 && !magnetic;
        let axis = if many { axes[k] } else { mode.axis };
        modes.push(ModeReport {
            axis: axis.into(),
            roundness: if many { 0.0 } else { mode.roundness },
            transition: mode.frequency,
            transition_error: error,
            decay_rate: mode.rate,
            held: mode.is_held(),
            mathieu,
            small_q,
            small_q_error,
            spectrum: spectrum.map(|line| line.frequency),
            spectrum_error,
            agree: same(spectrum.map(|l| l.frequency), spectrum_error) && same(small_q, small_q_error),
        });
    }
    let error_estimate = modes.iter().map(|m| m.transition_error).fold(0.0, f64::max);
    Ok(SecularReport { held: modes.iter().all(|m| m.held), modes, error_estimate })
}

/// The line of the motion along any axis that is nearest to a frequency, of those that are not lost beside the strongest.
fn nearest_line(lines: &[Vec<Measured>; 3], frequency: f64) -> Option<Measured> {
    if frequency == 0.0 {
        return None;
    }
    let strong = lines.iter().flat_map(|along| {
        let largest = along.first().map_or(0.0, |line| line.amplitude);
        along.iter().filter(move |line| line.amplitude > 1e-3 * largest)
    });
    strong.copied().min_by(|a, b| (a.frequency - frequency).abs().total_cmp(&(b.frequency - frequency).abs()))
}

/// The depth of a well that opens at an electrode, on the true surface in place of the panels that show it: from a point beside the
/// panel it is as far as the electrode's own unit potential is from one, over its slope.
pub(crate) fn on_surface(
    space: &Space,
    solution: &Solution,
    electrodes: usize,
    potential: &Effective,
    floor: f64,
    mut well: Well,
) -> Well {
    let Opening::Wall(electrode) = well.opening else { return well };
    if electrode >= electrodes {
        return well;
    }
    let eye = well.beside;
    let units = solution.basis.panel_sum();
    let mut samples = Samples::default();
    field::BasisField::sample(&units, &[eye], &mut samples);
    let (own, slope) = (samples.potential[electrode], samples.gradient[electrode]);
    let distance = (1.0 - own) / slope.norm();
    if !distance.is_finite() || distance.abs() > 0.3 * space.size {
        return well;
    }
    let out = slope / slope.norm();
    let near = [eye, eye - out * distance.abs(), eye - out * (2.0 * distance.abs())];
    let values = potential.values(space.field, &near, &mut samples);
    // A parabola through three places on the way, carried on to the surface.
    let surface = 3.0 * values[0] - 3.0 * values[1] + values[2];
    let depth = surface - floor;
    // What the last step changed, a tenth of it.
    well.error = 2.0 * space.error * depth + 0.1 * (depth - well.depth).abs() + 0.02 * (surface - values[0]).abs();
    well.depth = depth;
    well
}

fn depth(ground: &Ground, group: &GrainGroup, well: &Well) -> Depth {
    let joules = well.depth * group.mass;
    let volts = if group.charge == 0.0 { 0.0 } else { joules / group.charge.abs() };
    let opening = match well.opening {
        Opening::Pass => "saddle".to_owned(),
        Opening::Edge => "edge".to_owned(),
        Opening::Wall(e) => ground.case.electrodes.get(e).map_or(GROUND.to_owned(), |e| e.name.clone()),
    };
    Depth {
        value: joules / E,
        error_estimate: well.error * group.mass / E,
        volts,
        joules,
        opening,
        point: well.point.into(),
    }
}

fn offset(
    ground: &Ground,
    group: &GrainGroup,
    potential: &Effective,
    minimum: &CriticalPoint,
    acceleration: Vec3,
) -> Offset {
    let specific = group.charge / group.mass;
    let without = Effective { slope: Vec3::zeros(), ..potential.clone() };
    let reach = 2.0 * ground.space.room(&minimum.position);
    let null = polish(&ground.space, &without, &minimum.position, reach).map_or(minimum.position, |c| c.position);
    let shift = if acceleration == Vec3::zeros() { Vec3::zeros() } else { minimum.position - null };
    let soft = |c: f64| if c > 0.0 { specific / c } else { 0.0 };
    let pushed = acceleration != Vec3::zeros() && specific != 0.0;
    Offset {
        shift: shift.into(),
        per_field: minimum.curvatures.map(soft),
        compensation: pushed.then(|| compensation(ground, &null, -acceleration / specific)).flatten(),
    }
}

/// Smallest voltages that make a field at a point, of electrodes that do not float.
fn compensation(ground: &Ground, at: &Vec3, field: Vec3) -> Option<Compensation> {
    let case = ground.case;
    let chosen: Vec<usize> =
        (0..case.electrodes.len()).filter(|e| matches!(case.electrodes[*e].drive, Drive::Voltage(_))).collect();
    if chosen.is_empty() {
        return None;
    }
    let mut samples = Samples::default();
    field::BasisField::sample(&ground.solution.basis.panel_sum(), &[*at], &mut samples);
    let rows: Vec<Vec<f64>> = (0..3).map(|k| chosen.iter().map(|e| -samples.gradient[*e][k]).collect()).collect();
    // Fields a million times weaker than the strongest are rounding and no way to push a grain.
    let strongest = rows.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
    let clean = |x: &f64| if x.abs() < 1e-6 * strongest { 0.0 } else { *x };
    let rows: Vec<Vec<f64>> = rows.iter().map(|row| row.iter().map(clean).collect()).collect();
    let found = voltages(&rows, field.as_slice(), f64::INFINITY, 1e-6);
    Some(Compensation {
        field: field.into(),
        volts: chosen.iter().zip(&found.values).map(|(e, v)| (case.electrodes[*e].name.clone(), (*v).into())).collect(),
        residual: [0, 1, 2].map(|k| found.residual[k]),
    })
}
