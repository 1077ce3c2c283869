//! What the 3D view draws: electrodes, tracks, null points.
//!
//! Places are told in halves of the size of the picture from its middle, as f32: 1e-7 of the picture is far below a pixel.
//! Times are told as parts of the flight, from 0 to 1.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use meshes::Vec3;
use meshes::import::DataSet;
use serde::Serialize;
use serde_json::Value;

use super::Found;
use super::numeral::grouped;
use super::simplify::simplified;

/// Triangles that are drawn at most: some 20 bytes of the page each.
const TRIANGLES: usize = 200_000;
/// Samples of tracks that are drawn at most: some 22 bytes of the page each.
const SAMPLES: usize = 250_000;
/// Grains that are drawn at most.
const GRAINS: usize = 20_000;
/// Numbers of charge densities at 1 V that are added at most.
const UNIT_DENSITIES: usize = 400_000;

/// A scene.
#[derive(Debug, Serialize)]
pub struct Scene {
    /// Middle of the picture, m.
    center: [f64; 3],
    /// Half of its size, m.
    size: f64,
    /// Lower corner of what is drawn, in halves of the size.
    low: [f64; 3],
    /// Upper corner.
    high: [f64; 3],
    electrodes: Vec<Electrode>,
    /// Three f32 for each vertex.
    vertices: String,
    /// Three u32 for each triangle, those of the first electrode first.
    triangles: String,
    densities: Vec<Density>,
    tracks: Option<Tracks>,
    marks: Vec<Mark>,
    /// What a person should know of the picture.
    #[serde(skip)]
    pub notes: Vec<String>,
}

/// A range of triangles.
#[derive(Debug, Serialize)]
struct Electrode {
    name: String,
    /// V at the start.
    voltage: Option<f64>,
    /// C at the start.
    charge: Option<f64>,
    first: usize,
    count: usize,
}

/// Numbers on triangles.
#[derive(Debug, Serialize)]
struct Density {
    name: String,
    unit: &'static str,
    /// One f32 for each triangle.
    values: String,
}

/// Where grains were.
#[derive(Debug, Serialize)]
struct Tracks {
    /// Time of the first and the last sample, s.
    start: f64,
    end: f64,
    /// Samples of each grain, u32.
    lengths: String,
    /// Number of each grain, u32.
    grains: String,
    /// How it ended, u32: 0 still flying, 1 struck, 2 left the region, 3 unstable.
    outcomes: String,
    /// Three f32 for each sample.
    points: String,
    /// One f32 for each sample.
    times: String,
}

/// A point of the field.
#[derive(Debug, Serialize)]
struct Mark {
    /// `null` or `minimum`.
    kind: &'static str,
    /// Of which field, for which grains.
    of: String,
    position: [f64; 3],
}

impl Scene {
    /// Of what was found; nothing where there is neither surface nor track.
    pub fn new(found: &Found) -> Option<Self> {
        let mut notes = Vec::new();
        let surface = found.surface.as_ref().filter(|surface| !surface.ends.is_empty());
        let tracks = found.tracks.as_ref().filter(|tracks| !tracks.ends.is_empty());
        let bounds = bounds(surface, tracks)?;
        let scale = Scale { center: (bounds.0 + bounds.1) / 2.0, size: half_size(&bounds) };
        let mut scene = Self {
            center: scale.center.into(),
            size: scale.size,
            low: scale.of(&bounds.0).into(),
            high: scale.of(&bounds.1).into(),
            electrodes: Vec::new(),
            vertices: String::new(),
            triangles: String::new(),
            densities: Vec::new(),
            tracks: tracks.map(|tracks| Tracks::new(tracks, &scale, &mut notes)),
            marks: found.analysis.as_ref().map(|analysis| marks(analysis, &scale)).unwrap_or_default(),
            notes: Vec::new(),
        };
        if let Some(surface) = surface {
            scene.electrodes(surface, found.run.as_ref(), &scale, &mut notes);
        }
        scene.notes = notes;
        Some(scene)
    }

    fn electrodes(&mut self, surface: &DataSet, run: Option<&Value>, scale: &Scale, notes: &mut Vec<String>) {
        let number = surface.cell_array("electrode").unwrap_or_default();
        let mut triangles: Vec<([u32; 3], usize)> =
            surface.cells().map(|cell| [cell[0], cell[1], cell[2]]).enumerate().map(|(k, t)| (t, k)).collect();
        triangles.sort_by_key(|(_, k)| number[*k] as i64);
        let all = triangles.len();
        let shown = simplified(&surface.points, triangles, TRIANGLES);
        if shown.triangles.len() < all {
            let few = grouped(shown.triangles.len() as u64);
            notes.push(format!("The surface is drawn with {few} of its {} triangles.", grouped(all as u64)));
        }
        let names = names(surface, run);
        // Voltages and charges are told of a surface with these electrodes only.
        let run = run.filter(|_| names.starts_with(&told(run)));
        for (first, (_, k)) in shown.triangles.iter().enumerate() {
            let of = number[*k] as usize;
            while self.electrodes.len() <= of {
                let k = self.electrodes.len();
                let name = names.get(k).cloned().unwrap_or_else(|| format!("electrode {}", k + 1));
                let at = |key: &str| run.and_then(|run| run[key][k].as_f64());
                let (voltage, charge) = (at("voltages_at_start"), at("charges_at_start"));
                self.electrodes.push(Electrode { name, voltage, charge, first, count: 0 });
            }
            self.electrodes[of].count += 1;
        }
        self.vertices = floats(shown.vertices.iter().flat_map(|v| <[f64; 3]>::from(scale.of(v))));
        self.triangles = whole(shown.triangles.iter().flat_map(|(t, _)| *t));
        let mut put = |name: String, unit: &'static str, values: &[f64]| {
            let values = floats(shown.triangles.iter().map(|(_, k)| values[*k]));
            self.densities.push(Density { name, unit, values });
        };
        if let Some(total) = surface.cell_array("surface_charge_density") {
            put("at the start".to_owned(), "C/m²", total);
        }
        let units: Vec<_> = surface
            .cell_arrays
            .iter()
            .filter_map(|(name, values)| Some((name.strip_prefix("unit_charge_density ")?, values)))
            .collect();
        if units.len() > 1 && units.len() * shown.triangles.len() <= UNIT_DENSITIES {
            for (name, values) in units {
                put(format!("{name} at 1 V, the others at 0 V"), "C/(m² V)", values);
            }
        }
    }

    /// As JSON that may stand in a script element of a page.
    pub fn json(&self) -> String {
        // `</script>` in a name would end the element.
        serde_json::to_string(self).unwrap_or_default().replace('<', "\\u003c")
    }
}

/// From metres to the picture.
struct Scale {
    center: Vec3,
    size: f64,
}

impl Scale {
    fn of(&self, p: &Vec3) -> Vec3 {
        (p - self.center) / self.size
    }
}

type Bounds = (Vec3, Vec3);

fn half_size(bounds: &Bounds) -> f64 {
    let size = (bounds.1 - bounds.0).amax() / 2.0;
    if size > 0.0 { size } else { 1.0 }
}

/// The box of the electrodes, and of the tracks as far as they are near: grains that left far behind would make the trap a dot.
fn bounds(surface: Option<&DataSet>, tracks: Option<&DataSet>) -> Option<Bounds> {
    let of = |set: Option<&DataSet>| -> Option<Bounds> {
        let points = || set.into_iter().flat_map(|set| &set.points).copied();
        Some((points().reduce(|a, b| a.inf(&b))?, points().reduce(|a, b| a.sup(&b))?))
    };
    match (of(surface), of(tracks)) {
        (Some(electrodes), Some(flown)) => {
            let (middle, reach) = ((electrodes.0 + electrodes.1) / 2.0, Vec3::repeat(1.5 * half_size(&electrodes)));
            let near = (flown.0.sup(&(middle - reach)), flown.1.inf(&(middle + reach)));
            Some((electrodes.0.inf(&near.0), electrodes.1.sup(&near.1)))
        }
        (one, other) => one.or(other),
    }
}

/// Names of the electrodes, from their unit solutions (sources have some too, behind them), else from the summary.
fn names(surface: &DataSet, run: Option<&Value>) -> Vec<String> {
    let unit = surface.cell_arrays.iter().filter_map(|(name, _)| name.strip_prefix("unit_charge_density "));
    let unit: Vec<String> = unit.map(str::to_owned).collect();
    if unit.is_empty() { told(run) } else { unit }
}

/// Names of the electrodes that the summary tells of.
fn told(run: Option<&Value>) -> Vec<String> {
    let names = run.and_then(|run| run["electrodes"].as_array()).into_iter().flatten();
    names.filter_map(Value::as_str).map(str::to_owned).collect()
}

impl Tracks {
    fn new(set: &DataSet, scale: &Scale, notes: &mut Vec<String>) -> Self {
        let time = set.point_array("time").unwrap_or_default();
        let outcome = set.cell_array("outcome").unwrap_or_default();
        let grain = set.cell_array("grain");
        let mut cells: Vec<(u32, u32, &[u32])> = set
            .cells()
            .enumerate()
            .map(|(k, cell)| (grain.map_or(k as u32, |grain| grain[k] as u32), outcome[k] as u32, cell))
            .collect();
        cells.sort_by_key(|(grain, ..)| *grain);
        let grains = cells.len();
        if grains > GRAINS {
            let every = grains.div_ceil(GRAINS);
            cells = cells.into_iter().step_by(every).collect();
            notes.push(format!("Of {} grains every {every}th is drawn.", grouped(grains as u64)));
        }
        let samples: usize = cells.iter().map(|(_, _, cell)| cell.len()).sum();
        // The last sample of each stays, and belongs to the number.
        let stride = samples.div_ceil(SAMPLES.saturating_sub(cells.len()).max(1)).max(1);
        if stride > 1 {
            notes.push(format!(
                "Of {} samples one in {stride} is drawn: fast motion between them is not to be seen.",
                grouped(samples as u64)
            ));
        }
        let (mut lengths, mut kept) = (Vec::with_capacity(cells.len()), Vec::new());
        for (_, _, cell) in &cells {
            let before = kept.len();
            kept.extend(cell.iter().step_by(stride).map(|v| *v as usize));
            if !(cell.len().saturating_sub(1)).is_multiple_of(stride) {
                kept.extend(cell.last().map(|v| *v as usize));
            }
            lengths.push((kept.len() - before) as u32);
        }
        let start = kept.iter().map(|v| time[*v]).fold(f64::INFINITY, f64::min);
        let end = kept.iter().map(|v| time[*v]).fold(start, f64::max);
        let part = |v: &usize| if end > start { (time[*v] - start) / (end - start) } else { 0.0 };
        Self {
            start,
            end,
            lengths: whole(lengths),
            grains: whole(cells.iter().map(|(grain, ..)| *grain)),
            outcomes: whole(cells.iter().map(|(_, outcome, _)| *outcome)),
            points: floats(kept.iter().flat_map(|v| <[f64; 3]>::from(scale.of(&set.points[*v])))),
            times: floats(kept.iter().map(part)),
        }
    }
}

/// Null points of an analysis, and the minima of the effective potential of its first grains.
fn marks(analysis: &Value, scale: &Scale) -> Vec<Mark> {
    let nulls = analysis["nulls"].as_array().into_iter().flatten();
    let word = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let nulls = nulls.map(|null| ("null", word(&null["of"]), &null["position"]));
    let minima = analysis["species"][0]["effective"].as_array().into_iter().flatten();
    let minima = minima
        .filter(|point| point["kind"] == "minimum")
        .map(|point| ("minimum", word(&analysis["species"][0]["name"]), &point["position"]));
    let mark = |(kind, of, position): (&'static str, String, &Value)| {
        let [x, y, z] = [0, 1, 2].map(|k| position[k].as_f64());
        Some(Mark { kind, of, position: scale.of(&Vec3::new(x?, y?, z?)).into() })
    };
    nulls.chain(minima).filter_map(mark).collect()
}

fn floats(values: impl IntoIterator<Item = f64>) -> String {
    STANDARD.encode(values.into_iter().flat_map(|x| (x as f32).to_le_bytes()).collect::<Vec<u8>>())
}

fn whole(values: impl IntoIterator<Item = u32>) -> String {
    STANDARD.encode(values.into_iter().flat_map(u32::to_le_bytes).collect::<Vec<u8>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unpacked(text: &str) -> Vec<f32> {
        let bytes = STANDARD.decode(text).unwrap();
        bytes.chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
    }

    fn numbers(text: &str) -> Vec<u32> {
        STANDARD.decode(text).unwrap().chunks(4).map(|b| u32::from_le_bytes(b.try_into().unwrap())).collect()
    }

    /// Tracks of grains on the line y = grain, from x = 0 to 1.
    fn tracks(grains: usize, samples: usize) -> DataSet {
        let mut set = DataSet::default();
        let (mut time, mut grain) = (Vec::new(), Vec::new());
        // The file has its cells in some other order than the grains.
        for g in (0..grains).rev() {
            for k in 0..samples {
                set.corners.push(set.points.len() as u32);
                set.points.push(Vec3::new(k as f64 / (samples - 1) as f64, g as f64, 0.0));
                time.push(5.0 + k as f64);
            }
            set.ends.push(set.corners.len());
            grain.push(g as f64);
        }
        set.point_arrays = vec![("time".into(), time)];
        set.cell_arrays = vec![("outcome".into(), vec![1.0; grains]), ("grain".into(), grain)];
        set
    }

    fn scene(tracks: DataSet, surface: Option<DataSet>) -> Scene {
        Scene::new(&Found { tracks: Some(tracks), surface, ..Found::default() }).unwrap()
    }

    #[test]
    fn tracks_are_told_in_the_order_of_the_grains() {
        let scene = scene(tracks(3, 5), None);
        let told = scene.tracks.as_ref().unwrap();
        assert_eq!((numbers(&told.grains), numbers(&told.lengths)), (vec![0, 1, 2], vec![5; 3]));
        assert_eq!((told.start, told.end, &unpacked(&told.times)[..5]), (5.0, 9.0, &[0.0, 0.25, 0.5, 0.75, 1.0][..]));
        let points = unpacked(&told.points);
        // The second grain's last sample, back in metres.
        let back =
            Vec3::new(points[27].into(), points[28].into(), points[29].into()) * scene.size + Vec3::from(scene.center);
        assert_eq!(back, Vec3::new(1.0, 1.0, 0.0));
        assert!(scene.notes.is_empty());
    }

    #[test]
    fn long_tracks_are_thinned_and_it_is_said() {
        let scene = scene(tracks(1000, 1001), None);
        let told = scene.tracks.as_ref().unwrap();
        let lengths = numbers(&told.lengths);
        assert!(lengths.iter().sum::<u32>() as usize <= SAMPLES);
        // Beginning and end are there.
        let (times, points) = (unpacked(&told.times), unpacked(&told.points));
        let last = lengths[0] as usize - 1;
        assert_eq!(
            (times[0], times[last], points[0], points[3 * last]),
            (0.0, 1.0, points[0], points[0] + (1.0 / scene.size) as f32)
        );
        assert!(scene.notes[0].contains("one in"), "{:?}", scene.notes);
        assert!(scene.json().len() < 8_000_000);
    }

    #[test]
    fn grains_far_away_do_not_make_the_trap_a_dot() {
        let surface = DataSet {
            points: vec![Vec3::zeros(), Vec3::x() * 1e-3, Vec3::y() * 1e-3],
            corners: vec![0, 1, 2],
            ends: vec![3],
            cell_arrays: vec![("electrode".into(), vec![0.0])],
            ..DataSet::default()
        };
        let scene = scene(tracks(2, 3), Some(surface));
        assert!(scene.size < 2e-3 && scene.electrodes.len() == 1, "{scene:?}");
    }
}
