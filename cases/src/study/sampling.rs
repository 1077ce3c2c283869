//! Points of the unit cube for studies that draw samples.

use tracer::stream::{Purpose, Stream};

use crate::case::Sampling;

/// Points of the unit cube, one coordinate in [0, 1) for each key, the same for the same seed.
///
/// * Latin hypercube: of each coordinate one value in each of `count` equal parts, at a random place in it, in random order.
///   Source: McKay, Beckman and Conover 1979, section 2.
/// * Sobol: the first points of the sequence, scrambled after Owen (1995) with the seed. They come in single precision: a
///   coordinate is a multiple of 2^-24.
///
/// Checked by `each_part_of_a_range_has_one_sample` and `sobol_fills_the_square`.
///
/// # Errors
/// More coordinates than Sobol's sequence is tabulated for: that number.
pub fn unit_samples(sampling: Sampling, count: usize, keys: usize, seed: u64) -> Result<Vec<Vec<f64>>, usize> {
    if sampling == Sampling::Sobol {
        let most = sobol_burley::NUM_DIMENSIONS as usize;
        if keys > most {
            return Err(most);
        }
        // The crate takes 32 bits of seed.
        let seed = (seed ^ (seed >> 32)) as u32;
        let point = |n: usize| (0..keys).map(|k| f64::from(sobol_burley::sample(n as u32, k as u32, seed))).collect();
        return Ok((0..count).map(point).collect());
    }
    let mut samples = vec![vec![0.0; keys]; count];
    for key in 0..keys {
        let mut stream = Stream::new(seed, Purpose::Sample, key as u64, 0);
        let mut parts: Vec<usize> = (0..count).collect();
        // Fisher and Yates: every order with the same probability.
        for n in (1..count).rev() {
            parts.swap(n, (stream.unit() * (n + 1) as f64) as usize);
        }
        for (sample, part) in samples.iter_mut().zip(parts) {
            sample[key] = (part as f64 + stream.unit()) / count as f64;
        }
    }
    Ok(samples)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_part_of_a_range_has_one_sample() {
        let samples = unit_samples(Sampling::LatinHypercube, 50, 3, 7).unwrap();
        for key in 0..3 {
            let mut parts: Vec<usize> = samples.iter().map(|s| (s[key] * 50.0) as usize).collect();
            assert!(parts.windows(2).any(|pair| pair[0] > pair[1]), "in no order");
            parts.sort_unstable();
            assert_eq!(parts, (0..50).collect::<Vec<_>>());
        }
        assert_eq!(samples, unit_samples(Sampling::LatinHypercube, 50, 3, 7).unwrap());
        assert_ne!(samples, unit_samples(Sampling::LatinHypercube, 50, 3, 8).unwrap());
    }

    #[test]
    fn sobol_fills_the_square() {
        // A (t, m, 2)-net with t = 0: 64 points have one in each of 8 x 8 boxes, however scrambled.
        let samples = unit_samples(Sampling::Sobol, 64, 2, 3).unwrap();
        let mut boxes = [0; 64];
        samples.iter().for_each(|s| boxes[8 * (s[0] * 8.0) as usize + (s[1] * 8.0) as usize] += 1);
        assert_eq!(boxes, [1; 64]);
        assert!(unit_samples(Sampling::Sobol, 4, 100_000, 3).is_err());
    }
}
