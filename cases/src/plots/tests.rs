use super::axis::Axis;
use super::prefix::axis_unit;
use super::*;

/// `count` grains that oscillate `cycles` times in `samples` samples.
fn tracks(count: usize, samples: usize, cycles: f64) -> Vec<Track> {
    let track = |grain: usize| {
        let phase = |i: usize| std::f64::consts::TAU * cycles * i as f64 / samples as f64 + grain as f64;
        Track {
            grain,
            times: (0..samples).map(|i| 1e-4 * i as f64).collect(),
            positions: (0..samples).map(|i| [0.0, 0.5, 1.0].map(|k| 1e-3 * (phase(i) + k).sin())).collect(),
            velocities: (0..samples).map(|i| [0.0, 0.5, 1.0].map(|k| 0.2 * (phase(i) + k).cos())).collect(),
            ended: [Ending::TimeUp, Ending::Struck, Ending::Left][grain % 3],
        }
    };
    (0..count).map(track).collect()
}

/// What an SVG holds: its texts, and the points of its curves (lines of the palette, pale or not).
struct Drawn {
    texts: Vec<String>,
    lines: Vec<Vec<[f64; 2]>>,
}

fn drawn(figure: &Figure) -> Drawn {
    let svg = figure.svg().unwrap();
    assert!(svg.len() < 2_000_000, "{} bytes", svg.len());
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "a coordinate or tick is not finite");
    let document = roxmltree::Document::parse(&svg).unwrap();
    let is = |name: &'static str| document.descendants().filter(move |node| node.has_tag_name(name));
    let texts = is("text").filter_map(|node| node.text().map(str::to_owned)).collect();
    let curves = is("path").filter(|node| node.attribute("fill") == Some("none"));
    // Axes and crosses are written "M 1 2", curves "M1.0 2.0".
    let points = curves.filter_map(|node| node.attribute("d")).filter(|d| !d.starts_with("M "));
    let number = |text: &str| text.parse::<f64>().unwrap();
    let lines = points.map(|d| {
        let pairs = d[1..].split('L').map(|pair| pair.split_once(' ').unwrap());
        pairs.map(|(x, y)| [number(x), number(y)]).collect()
    });
    Drawn { texts, lines: lines.collect() }
}

fn says(figure: &Figure, text: &str) -> bool {
    drawn(figure).texts.iter().any(|t| t == text)
}

fn size(png: &[u8]) -> (u32, u32) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!(pixels[..3], [255; 3], "the ground is white");
    assert!(pixels.iter().any(|&byte| byte < 64), "something is drawn");
    (info.width, info.height)
}

#[test]
fn both_formats_come_from_one_figure_and_are_repeatable() {
    let few = tracks(3, 500, 4.0);
    for (figure, expected) in [(coordinates("three", &few), (1200, 900)), (phase_planes("three", &few), (1400, 600))] {
        assert_eq!(figure.svg().unwrap(), figure.svg().unwrap());
        let png = figure.png().unwrap();
        assert_eq!(png, figure.clone().png().unwrap());
        assert_eq!(size(&png), expected);
        assert_eq!(drawn(&figure).lines.len(), 9, "three grains in three panels");
        for text in ["three", "3 grains", "grain 0", "grain 2", "time up", "struck", "left the region"] {
            assert!(says(&figure, text), "{text}");
        }
    }
}

#[test]
fn of_many_grains_some_are_drawn_and_the_figure_says_so() {
    let many = tracks(1000, 300, 4.0);
    for figure in [coordinates("many", &many), phase_planes("many", &many)] {
        let drawn = drawn(&figure);
        assert_eq!(drawn.lines.len(), 300);
        assert!(drawn.texts.iter().any(|t| t == "100 of 1000 grains"));
        assert!(!drawn.texts.iter().any(|t| t.starts_with("grain ")), "none is named");
    }
    let chosen = track::drawn(&many);
    assert_eq!((chosen[0].grain, chosen[99].grain), (0, 999));
    assert_eq!(track::drawn(&many[..42]).len(), 42);
}

#[test]
fn oscillations_keep_their_extremes() {
    // A spike one sample wide among 10⁵.
    let mut long = tracks(1, 100_000, 3000.0);
    long[0].positions[61_803][1] = 5e-3;
    let drawn = drawn(&coordinates("long", &long));
    assert!(drawn.lines.iter().all(|line| line.len() < 4 * 1200 && line.len() > 1000));
    let top = drawn.lines[1].iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
    let next = drawn.lines[1].iter().map(|p| p[1]).filter(|&y| y > top).fold(f64::INFINITY, f64::min);
    assert!(next - top > 50.0, "the spike stands {} pixels above the rest", next - top);

    let points: Vec<_> = (0..10_000).map(|i| [f64::from(i), (f64::from(i) * 0.7).sin()]).collect();
    let thinned = thin::by_column(&points, 0.0, 1e4, 100);
    assert!(thinned.len() <= 400);
    for column in 0..100 {
        let within = |p: &&[f64; 2]| (p[0] / 100.0).floor() as i32 == column;
        let range = |points: &[[f64; 2]]| {
            let ys = points.iter().filter(within).map(|p| p[1]);
            ys.fold((2.0, -2.0), |(low, high): (f64, f64), y| (low.min(y), high.max(y)))
        };
        assert_eq!(range(&thinned), range(&points));
    }
}

#[test]
fn long_tracks_in_the_plane_stay_small_and_keep_their_extremes() {
    let points: Vec<_> = (0..100_000).map(|i| f64::from(i) * 0.1).map(|t| [t.cos() * t, t.sin() * t]).collect();
    let thinned = thin::by_plane(&points, [1.0, 1.0], 2000);
    assert!(thinned.len() <= 2500, "{}", thinned.len());
    for k in 0..2 {
        let range = |points: &[[f64; 2]]| {
            let drawn = points.iter().map(|p| p[k]).filter(|v| v.is_finite());
            drawn.fold((0.0, 0.0), |(low, high): (f64, f64), v| (low.min(v), high.max(v)))
        };
        let (thin, full) = (range(&thinned), range(&points));
        assert!((thin.0 - full.0).abs() <= 1.0 && (thin.1 - full.1).abs() <= 1.0, "within the resolution");
    }
    drawn(&phase_planes("ten long", &tracks(10, 100_000, 3000.1)));
    drawn(&phase_planes("many long", &tracks(100, 5_000, 300.1)));
    drawn(&coordinates("many long", &tracks(100, 5_000, 300.1)));
}

#[test]
fn what_is_not_finite_is_a_gap() {
    let mut gaps = tracks(1, 100, 1.0);
    gaps[0].positions[40][0] = f64::NAN;
    gaps[0].positions[60][0] = f64::INFINITY;
    assert_eq!(drawn(&coordinates("gaps", &gaps)).lines.len(), 3 + 1 + 1);
    assert_eq!(drawn(&phase_planes("gaps", &gaps)).lines.len(), 3 + 1 + 1);
    gaps[0].times.fill(f64::NAN);
    gaps[0].positions.fill([f64::NEG_INFINITY; 3]);
    assert!(drawn(&coordinates("nothing", &gaps)).lines.is_empty());
}

#[test]
fn conductors_are_gaps_on_grey_ground() {
    let potential = |z: f64| if (0.0095..0.0205).contains(&z) { f64::NAN } else { 2e3 * z };
    let points = (0..=40).map(|i| 1e-3 * f64::from(i)).map(|z| [z, potential(z)]).collect();
    let figure = axis_potential("axis", "x", &[("static".to_owned(), points)]);
    assert_eq!((&*figure.panels[0].x_label, &*figure.panels[0].y_label), ("x (mm)", "potential (V)"));
    let [band] = &figure.panels[0].bands[..] else { panic!("{:?}", figure.panels[0].bands) };
    assert!((band.span[0] - 9.5).abs() < 1e-9 && (band.span[1] - 20.5).abs() < 1e-9, "{:?}", band.span);
    assert_eq!(drawn(&figure).lines.len(), 2);
    assert!(says(&figure, "inside a conductor"));
    figure.png().unwrap();

    let solid = axis_potential("solid", "x", &[("static".to_owned(), vec![[0.0, f64::NAN], [1.0, f64::NAN]])]);
    assert_eq!(solid.panels[0].bands[0].span, [0.0, 1.0]);
    drawn(&solid);
}

#[test]
fn awkward_input_gives_a_figure() {
    assert!(says(&coordinates("empty", &[]), "no grains"));
    assert!(says(&phase_planes("empty", &[]), "no grains"));
    assert!(says(&axis_potential("empty", "z", &[]), "no points"));
    drawn(&axis_potential("no points", "z", &[("nothing".to_owned(), vec![])]));

    let scaled = |size: f64, duration: f64, samples: usize| {
        let mut tracks = tracks(2, samples, 1.0);
        for track in &mut tracks {
            track.times.iter_mut().for_each(|t| *t *= duration);
            track.positions.iter_mut().flatten().for_each(|x| *x *= size);
            track.velocities.iter_mut().flatten().for_each(|v| *v *= size);
        }
        tracks
    };
    let sizes = [0.0, 1e-300, 1e-9, 1.0, 1e9, 1e150, f64::MAX];
    for (size, samples) in sizes.into_iter().flat_map(|size| [0, 1, 2, 50].map(|samples| (size, samples))) {
        for duration in [0.0, 1e-12, 1e10] {
            let tracks = scaled(size, duration, samples);
            for figure in [coordinates("scaled", &tracks), phase_planes("scaled", &tracks)] {
                drawn(&figure);
            }
        }
        coordinates("scaled", &scaled(size, 1.0, samples)).png().unwrap();
    }
    // Lists of unequal length, times that do not advance.
    let mut uneven = scaled(1.0, 1.0, 50);
    uneven[0].velocities.truncate(7);
    uneven[1].times.reverse();
    drawn(&coordinates("uneven", &uneven));
    drawn(&phase_planes("uneven", &uneven));
}

#[test]
fn texts_are_taken_literally() {
    let title = "V < 5 & \"q\" costs $5 or $6\u{0}";
    let figure = axis_potential(title, "z", &[("<b>$x$".to_owned(), vec![[0.0, 1.0], [1.0, 2.0]])]);
    assert!(says(&figure, "V < 5 & \"q\" costs $5 or $6 "), "{:?}", drawn(&figure).texts);
    assert!(says(&figure, "<b>$x$"));
    let long = Figure { title: "long ".repeat(100), ..figure };
    assert!(drawn(&long).texts.iter().any(|t| t.starts_with("long") && t.ends_with('…') && t.len() < 200));
}

#[test]
fn sheets_without_room_are_refused() {
    let figure = coordinates("small", &tracks(1, 10, 1.0));
    let small = Figure { width: 200.0, height: 200.0, ..figure.clone() };
    assert!(matches!(small.svg(), Err(PlotError::TooSmall { panels: 3, .. })));
    let large = Figure { width: 1e6, ..figure.clone() };
    assert!(matches!(large.png(), Err(PlotError::TooLarge { .. })));
    let none = Figure { height: f64::NAN, ..figure };
    assert!(none.png().is_err());
}

#[test]
fn ticks_are_round_and_labels_tell_them_apart() {
    for (low, high) in [(0.0, 1.0), (-3.2, 7.9), (99.999, 100.001), (1e-7, 3e-7), (-4e8, 1e6), (5.0, 5.0), (0.0, 0.0)] {
        let axis = Axis::over([low, high].into_iter(), 0.05, 8);
        assert!(axis.min < low && high < axis.max && axis.step > 0.0, "{axis:?}");
        let (first, last) = ((axis.min / axis.step).ceil() as i64, (axis.max / axis.step).floor() as i64);
        assert!((3..=9).contains(&(last - first + 1)), "{axis:?}");
        let labels: Vec<_> = (first..=last).map(|i| axis.format().label(i as f64 * axis.step)).collect();
        assert!(labels.windows(2).all(|pair| pair[0] != pair[1]), "{labels:?}");
        assert!(labels.iter().all(|label| label.len() < 14), "{labels:?}");
    }
    let axis = Axis::over([-0.3, 0.3].into_iter(), 0.0, 6);
    assert_eq!([-0.1, 0.0, 0.2].map(|v| axis.format().label(v)), ["−0.1", "0", "0.2"]);
}

#[test]
fn prefixes_follow_the_largest_value() {
    let unit = |value: f64, si: &str, highest: i32| axis_unit([0.0, -value, f64::NAN].into_iter(), si, highest).name;
    assert_eq!(unit(5e-3, "m", 3), "mm");
    assert_eq!(unit(1e-3, "m", 3), "mm");
    assert_eq!(unit(0.3e-3, "m", 3), "µm");
    assert_eq!(unit(1e9, "m", 3), "km");
    assert_eq!(unit(30.0, "s", 0), "s");
    assert_eq!(unit(1e6, "s", 0), "s");
    assert_eq!(unit(2e-8, "s", 0), "ns");
    assert_eq!(unit(2500.0, "V", 6), "kV");
    assert_eq!(unit(0.0, "V", 6), "V");
    assert_eq!(axis_unit([2e-3].into_iter(), "m", 3).factor, 1e3);
}

#[test]
fn spectra_name_their_lines_and_their_limits() {
    // 12.3 turns in 1000 samples of 0.1 ms: 123 Hz.
    let all = tracks(3, 1000, 12.3);
    let figure = super::spectrum("spectrum", &all).unwrap();
    let drawn = drawn(&figure);
    // Only the first flew to the end; its lines are named above each panel.
    assert!(
        drawn.texts.iter().any(|t| t.starts_with("1 grain; entries 10.000 Hz apart; faster than 5000 Hz")),
        "{:?}",
        drawn.texts
    );
    assert_eq!(drawn.texts.iter().filter(|t| *t == "123.0 Hz").count(), 3, "{:?}", drawn.texts);
    assert!(super::spectrum("none flew to the end", &all[1..]).is_none());
    assert!(super::spectrum("short", &tracks(1, 50, 2.0)).is_none());
    assert!(super::spectrum("empty", &[]).is_none());
    let rest = Track { positions: vec![[0.0, 1.0, 2.0]; 1000], ..all[0].clone() };
    assert!(says(&super::spectrum("rest", &[rest]).unwrap(), "at rest"));
}

#[test]
fn tracks_in_space_have_equal_scales() {
    use meshes::{Placement, Shape as Electrode, SurfaceMesh, triangulate_to};
    let ball = triangulate_to(&Electrode::Sphere { radius: 2e-3 }, 2000).unwrap().0;
    let mesh = SurfaceMesh::assemble([("ball".to_owned(), ball.placed(&Placement::default()).unwrap())]);
    let edges = super::outlines(&mesh);
    let figure = super::tracks("ball", &edges, &tracks(2, 300, 4.0));
    let drawn = drawn(&figure);
    // The outline of a sphere is a circle wherever one looks from: as wide as it is high, to a facet's width.
    let outline = drawn.lines.iter().max_by(|a, b| extent(a, 0).total_cmp(&extent(b, 0))).unwrap();
    assert!((extent(outline, 0) / extent(outline, 1) - 1.0).abs() < 0.05, "{outline:?}");
    for text in ["grain 0", "grain 1", "electrodes", "x direction", "time up", "struck"] {
        assert!(drawn.texts.iter().any(|t| t == text), "{text}");
    }
    // Grains that left for far away do not make the trap a dot.
    let mut far = tracks(1, 300, 4.0);
    far[0].positions[299] = [10.0, 0.0, 0.0];
    let small = self::drawn(&super::tracks("far", &edges, &far));
    let widest = small.lines.iter().map(|line| extent(line, 0)).fold(0.0, f64::max);
    assert!(widest > 100.0, "{widest} pixels");
    assert!(says(&super::tracks("nothing", &[], &[]), "no grains, seen from azimuth -60°, elevation 22°"));
}

fn extent(line: &[[f64; 2]], k: usize) -> f64 {
    let of = |f: fn(f64, f64) -> f64, from: f64| line.iter().map(|p| p[k]).fold(from, f);
    of(f64::max, f64::NEG_INFINITY) - of(f64::min, f64::INFINITY)
}
