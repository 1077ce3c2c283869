//! One of n parts of a study, told by the command line or by whoever starts many of us at once.

use std::str::FromStr;

use super::points::Point;

/// The `index`-th (from 0) of `count` parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// From 0, below `count`.
    pub index: usize,
    /// At least 1.
    pub count: usize,
}

impl FromStr for Shard {
    type Err = String;

    /// `2/8`: the second of eight.
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || "two numbers i/n with i from 1 to n were expected, as 2/8".to_owned();
        let (index, count) = text.split_once('/').ok_or_else(wrong)?;
        let (index, count): (usize, usize) =
            (index.trim().parse().map_err(|_| wrong())?, count.trim().parse().map_err(|_| wrong())?);
        if index == 0 || index > count {
            return Err(wrong());
        }
        Ok(Self { index: index - 1, count })
    }
}

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{}/{}", self.index + 1, self.count)
    }
}

impl Shard {
    /// What the environment says, and the variable that says it: tasks of a Slurm array, else the ranks of Open MPI, of a launcher
    /// that speaks PMI (MPICH, Intel MPI), or of `srun`.
    ///
    /// A task of an array that itself starts several ranks has them share the points of the task.
    pub fn of_environment(variable: impl Fn(&str) -> Option<String>) -> Option<(Self, String)> {
        let number = |name: &str| variable(name)?.trim().parse::<usize>().ok();
        let of = |index: usize, count: usize| (index < count && count > 1).then_some(Self { index, count });
        let array = || {
            let (task, count) = (number("SLURM_ARRAY_TASK_ID")?, number("SLURM_ARRAY_TASK_COUNT")?);
            let least = number("SLURM_ARRAY_TASK_MIN").unwrap_or(0);
            // --array=2-8:2 counts in steps.
            let step = number("SLURM_ARRAY_TASK_STEP").filter(|step| *step > 0).unwrap_or(1);
            Some((of(task.checked_sub(least)? / step, count)?, "SLURM_ARRAY_TASK_ID"))
        };
        const RANKS: [[&str; 2]; 3] = [
            ["OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"],
            ["PMI_RANK", "PMI_SIZE"],
            ["SLURM_PROCID", "SLURM_NTASKS"],
        ];
        let rank = || RANKS.iter().find_map(|[rank, size]| Some((of(number(rank)?, number(size)?)?, *rank)));
        match (array(), rank()) {
            (Some((task, by)), Some((rank, and))) => {
                let both = Self { index: task.index * rank.count + rank.index, count: task.count * rank.count };
                Some((both, format!("{by} and {and}")))
            }
            (found, other) => found.or(other).map(|(shard, by)| (shard, by.to_owned())),
        }
    }

    /// The points of this part. Where there are solutions enough for all parts, points that share one stay together; else, as in
    /// a sweep of voltages, each part solves by itself and takes its share of the points.
    pub fn of_points(self, points: Vec<Point>) -> Vec<Point> {
        let mut solutions = Vec::new();
        for point in &points {
            if !solutions.contains(&point.solution) {
                solutions.push(point.solution);
            }
        }
        let together = solutions.len() >= self.count;
        let number = |point: &Point| match together {
            true => solutions.iter().position(|s| *s == point.solution).unwrap_or(0),
            false => point.number,
        };
        points.into_iter().filter(|point| number(point) % self.count == self.index).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(variables: &[(&str, &str)]) -> Option<String> {
        let variable = |name: &str| variables.iter().find(|(n, _)| *n == name).map(|(_, v)| (*v).to_owned());
        Shard::of_environment(variable).map(|(shard, by)| format!("{shard} {by}"))
    }

    #[test]
    fn launchers_say_which_part() {
        assert_eq!(of(&[]), None);
        let array = [
            ("SLURM_ARRAY_TASK_ID", "6"),
            ("SLURM_ARRAY_TASK_COUNT", "4"),
            ("SLURM_ARRAY_TASK_MIN", "2"),
            ("SLURM_ARRAY_TASK_STEP", "2"),
        ];
        assert_eq!(of(&array).unwrap(), "3/4 SLURM_ARRAY_TASK_ID");
        assert_eq!(of(&array[..3]), None, "task 6 - 2 is no part of 4");
        assert_eq!(
            of(&[("OMPI_COMM_WORLD_RANK", "1"), ("OMPI_COMM_WORLD_SIZE", "2")]).unwrap(),
            "2/2 OMPI_COMM_WORLD_RANK"
        );
        assert_eq!(of(&[("PMI_RANK", "0"), ("PMI_SIZE", "3")]).unwrap(), "1/3 PMI_RANK");
        // A job with one task, as any interactive one.
        assert_eq!(of(&[("SLURM_PROCID", "0"), ("SLURM_NTASKS", "1")]), None);
        // Ranks of Open MPI under Slurm: `mpirun` is one task of it.
        let both = [array[0], array[1], array[2], array[3], ("SLURM_PROCID", "1"), ("SLURM_NTASKS", "2")];
        assert_eq!(of(&both).unwrap(), "6/8 SLURM_ARRAY_TASK_ID and SLURM_PROCID");
    }

    #[test]
    fn parts_are_read_and_refused() {
        assert_eq!("2/8".parse(), Ok(Shard { index: 1, count: 8 }));
        for wrong in ["0/3", "4/3", "1", "a/b", "1/0", "-1/2"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn every_point_is_in_one_part() {
        let point = |number: usize, solution: u8| Point {
            number,
            values: Vec::new(),
            key: [number as u8; 32],
            solution: [solution; 32],
        };
        for solutions in [1, 2, 3, 7] {
            let all: Vec<Point> = (0..14).map(|n| point(n, (n % solutions) as u8)).collect();
            let parts: Vec<Vec<Point>> = (0..3).map(|index| Shard { index, count: 3 }.of_points(all.clone())).collect();
            let mut numbers: Vec<usize> = parts.iter().flatten().map(|p| p.number).collect();
            numbers.sort_unstable();
            assert_eq!(numbers, (0..14).collect::<Vec<_>>());
            assert!(parts.iter().all(|part| part.len() >= 4), "{solutions} solutions: shared out evenly");
            if solutions >= 3 {
                let owner = |s: u8| parts.iter().filter(|part| part.iter().any(|p| p.solution == [s; 32])).count();
                assert!((0..solutions as u8).all(|s| owner(s) == 1), "no solution is worked out twice");
            }
        }
    }
}
