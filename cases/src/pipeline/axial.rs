//! Solving on generating curves, where everything is round about one axis.

use std::time::Instant;

use field::axial::{AxialBody, AxialCharge, AxialError, AxialProblem, AxialSolution, AxialSource, AxialSum, Axis};
use field::{ElectrodeBasis, Errors, Samples};
use meshes::{Shape, Vec3, revolved};

use super::Failure;
use super::choice::axis_of;
use super::curved::field_difference;
use super::solution::{Solution, Work, trap_points};
use crate::case::Solver;

/// The accuracies that curves are solved to: below, rounding; above, there is nothing to gain.
const RANGE: [f64; 2] = [1e-11, 1e-2];

/// How much more is asked of the charges when the field is not right yet.
const STRICTER: f64 = 0.1;

/// How often.
const TRIALS: usize = 3;

impl Work<'_> {
    /// Solves on generating curves; `None` where the accuracy cannot be reached there.
    pub(super) fn solve_axial(&mut self) -> Result<Option<Solution>, Failure> {
        let Ok(Some(line)) = axis_of(&self.case.electrodes) else { return Ok(None) };
        let shown = self.shown_mesh()?;
        self.reporter.stage("solve on generating curves");
        let start = Instant::now();
        let e1 = line.direction.cross(&Vec3::ith(line.direction.iamin(), 1.0)).normalize();
        let axis = Axis { origin: line.point, frame: [e1, line.direction.cross(&e1), line.direction] };
        let bodies = self.bodies(&axis);
        let ground = self.case.field.ground;
        let of_source = |s: usize| {
            let source = self.sources[s];
            move |rho: f64, z: f64| {
                let point = axis.origin + axis.frame[0] * rho + axis.frame[2] * z;
                source.potential_and_gradient_above(ground.as_ref(), &point).0
            }
        };
        let closures: Vec<_> = (0..self.sources.len()).map(of_source).collect();
        let sources: Vec<AxialSource> = closures.iter().map(|f| f as AxialSource).collect();
        let height = ground.map(|plane| (plane.point - axis.origin).dot(&axis.frame[2]));
        let electrodes = self.case.electrodes.len();
        let problem = AxialProblem { bodies: &bodies, electrodes, sources: &sources, ground: height };
        let points = trap_points(self.case, &shown);
        let asked = self.case.field.accuracy;
        let mut wanted = asked.clamp(RANGE[0], RANGE[1]);
        for trial in 1.. {
            let (solution, judge) = match problem.solve_with_judge(wanted) {
                Ok(both) => both,
                Err(AxialError::SourceOnBody { source_number, .. }) => {
                    let text = format!("the field of source number {source_number} is infinite on an electrode");
                    let key = format!("source.{}.center", self.case.sources[source_number - 1].name);
                    return Err(self.source.error_at(&key, text, "move the source off the electrode").into());
                }
                Err(error) if self.case.field.solver == Solver::Axisymmetric => {
                    let help = "move electrodes apart, ask for a larger field.accuracy, or leave out `solver`";
                    return Err(self.source.error_at("field.solver", error.to_string(), help).into());
                }
                Err(_) => return Ok(None),
            };
            let field = self.field_error(&solution, &judge, axis, &points);
            let errors = Errors { capacitance: solution.data.capacitance_error, field };
            if errors.worst() <= asked || trial == TRIALS || wanted <= RANGE[0] {
                let charge = AxialCharge { solution, axis };
                let (sources, seconds) = (self.sources.to_vec(), start.elapsed().as_secs_f64());
                let basis = ElectrodeBasis::from_axial(shown, sources, ground, charge, seconds);
                self.solve_seconds += seconds;
                self.warn_of_accuracy(errors, basis.report.unknowns);
                return Ok(Some(self.done(basis, errors, "a better solution")));
            }
            wanted = (STRICTER * wanted).max(RANGE[0]);
        }
        unreachable!("the last trial returns")
    }

    /// The bodies of all electrodes on the axis.
    fn bodies(&self, axis: &Axis) -> Vec<AxialBody> {
        let mut bodies = Vec::new();
        for (electrode, (of, shape)) in self.case.electrodes.iter().zip(&self.electrodes.shapes).enumerate() {
            // `axis_of` has seen to both.
            let (Some(parts), Ok(frame)) = (revolved(shape), of.placement.frame()) else { continue };
            let turned = |v: &Vec3| frame[0] * v.x + frame[1] * v.y + frame[2] * v.z;
            for part in parts {
                let center = of.placement.center + turned(&part.center);
                // A sphere is round about any line through its centre.
                let against = turned(&part.frame[2]).dot(&axis.frame[2]) < 0.0;
                bodies.push(AxialBody {
                    profile: part.profile,
                    electrode,
                    height: (center - axis.origin).dot(&axis.frame[2]),
                    flipped: against && !matches!(shape, Shape::Sphere { .. }),
                });
            }
        }
        bodies
    }

    /// Largest difference of the unit fields of a solution from those of a better one, against the strongest of each.
    fn field_error(&self, solution: &AxialSolution, judge: &AxialSolution, axis: Axis, points: &[Vec3]) -> f64 {
        let [one, other] = [judge, solution].map(|s| {
            let mut samples = Samples::default();
            for sum in AxialSum::every(s, axis).sum(points).chunks_exact(4) {
                samples.potential.push(sum[0]);
                samples.gradient.push(Vec3::new(sum[1], sum[2], sum[3]));
            }
            samples
        });
        let ground = self.case.field.ground;
        let own = |s: usize, p: &Vec3| self.sources[s].potential_and_gradient_above(ground.as_ref(), p).1;
        field_difference(&one, &other, points, self.case.electrodes.len(), self.sources.len(), &own)
    }
}
