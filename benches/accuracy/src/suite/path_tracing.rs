//! Beside path tracing: what `benches/path_tracing.py` measured, from the tables in `benches/results`.
//!
//! Nothing is measured here: the references take hours of path tracing and lie outside the repository. The section shows the
//! recorded runs, and its rows hold them to their bounds.

use crate::plot::{Plot, Series};
use crate::{Bound, Row, Section};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// A bake is compared if it solves in 10 minutes on two cores: CPU time, seconds.
const MOST_CPU: f64 = 1200.0;

/// Scenes of the harness, how the page calls them, and the relative RMSE that is asked for.
const SCENES: [(&str, &str, f64); 2] = [("cornell", "Cornell box", 0.01), ("office", "office", 0.04)];

/// A bake compared with the reference: a row of `DATE-path-tracing.csv`, whose columns `path_tracing.py` explains.
#[derive(Clone, Debug, Deserialize)]
struct Run {
    series: String,
    scene: String,
    patch: f64,
    element: f64,
    cells: f64,
    until: f64,
    elements: u64,
    shots: u64,
    cpu: f64,
    rmse_raw: f64,
    rmse: f64,
    bias: f64,
    inside: u64,
    points: u64,
}

/// What another program reached: a row of `path-tracing-peers.csv`.
#[derive(Clone, Debug, Deserialize)]
struct Peer {
    program: String,
    scene: String,
    cpu: f64,
    rmse: f64,
}

/// The recorded runs.
pub fn measure() -> Section {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../results");
    let newest = newest_runs(&folder);
    let runs: Vec<Run> = read(&newest);
    let peers: Vec<Peer> = read(&folder.join("path-tracing-peers.csv"));
    let name = newest.file_name().unwrap_or_default().to_string_lossy();
    let mut section = Section {
        title: "Beside path tracing".into(),
        text: format!(
            "Irradiance at the elements' middles of a Cornell box (2,504 elements) and a furnished office (17,251), path-traced \
             for hours (standard errors 0.2 and 0.4 %), beside what our solutions show there (`ringlight probe --how surface`). \
             Relative RMSE: area-weighted over elements and channels, over the mean; over the elements whose middle is \
             unambiguous; the reference's standard error taken off in squares. Recorded by `benches/path_tracing.py` in \
             `benches/results/{name}`, not measured anew. The other programs' curves, in `benches/results/path-tracing-peers.csv`, \
             were measured on 2026-11-22 with two threads on a two-core Xeon with AVX-512, over all elements; of each program \
             the settings that no other of its settings beats in both time and error are drawn. CPU time: user and system, all \
             threads, seconds; ours on two cores of an AMD EPYC with AVX-512. Places that our probe finds inside things or in \
             cracks (*dark*) count as dark."
        ),
        ..Section::default()
    };
    for (scene, called, bound) in SCENES {
        let best =
            runs.iter().filter(|r| r.scene == scene && r.cpu <= MOST_CPU).map(|r| r.rmse).fold(f64::INFINITY, f64::min);
        let case = format!("{called}: least relative RMSE in 10 minutes on two cores");
        section.rows.push(Row { case, expected: bound, found: best, bound: Bound::AtMost });
    }
    section.table = Some(table(&runs));
    section.plots.extend(SCENES.map(|(scene, called, _)| against_time(scene, called, &runs, &peers)));
    section.plots.extend(
        [
            ("element", "element size, metres", (|r| r.element) as fn(&Run) -> f64),
            ("patch", "patch size, metres", |r| r.patch),
            ("cells", "cells of a shooter", |r| r.cells),
            ("until", "unshot share of the power", |r| r.until),
        ]
        .into_iter()
        .filter_map(|(series, axis, of)| against_setting(series, axis, of, &runs)),
    );
    section
}

/// The table of runs with the latest date in its name.
fn newest_runs(folder: &Path) -> PathBuf {
    let files =
        std::fs::read_dir(folder).expect("benches/results is there").filter_map(|entry| Some(entry.ok()?.path()));
    let runs = files.filter(|p| p.to_string_lossy().ends_with("-path-tracing.csv"));
    runs.max().expect("benches/results has runs of path_tracing.py")
}

fn read<T: for<'a> Deserialize<'a>>(path: &Path) -> Vec<T> {
    let rows = csv::Reader::from_path(path).and_then(|reader| reader.into_deserialize().collect());
    rows.unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn table(runs: &[Run]) -> (Vec<String>, Vec<Vec<String>>) {
    let headings = [
        "scene",
        "patches, m",
        "elements, m",
        "cells",
        "until",
        "elements",
        "shots",
        "CPU, s",
        "raw",
        "net",
        "bias",
        "dark",
    ];
    let percent = |x: f64| format!("{:.2} %", 100.0 * x);
    let cells = |r: &Run| {
        vec![
            r.scene.clone(),
            if r.patch >= WHOLE { "whole".into() } else { format!("{:.3}", r.patch) },
            format!("{:.3}", r.element),
            r.cells.to_string(),
            r.until.to_string(),
            r.elements.to_string(),
            r.shots.to_string(),
            format!("{:.1}", r.cpu),
            percent(r.rmse_raw),
            percent(r.rmse),
            percent(r.bias),
            format!("{} of {}", r.inside, r.points),
        ]
    };
    (headings.map(String::from).into(), runs.iter().map(cells).collect())
}

/// Patches of this size, metres, are the scene's faces.
const WHOLE: f64 = 100.0;

/// Error against CPU time, all programs.
fn against_time(scene: &str, called: &str, runs: &[Run], peers: &[Peer]) -> Plot {
    let ours = runs.iter().filter(|r| r.scene == scene).map(|r| [r.cpu, r.rmse]).collect();
    let mut series = vec![Series { name: "Ringlight".into(), points: unbeaten(ours) }];
    let mut programs: Vec<&str> = peers.iter().map(|p| p.program.as_str()).collect();
    programs.dedup();
    for program in programs {
        let points =
            peers.iter().filter(|p| p.scene == scene && p.program == program).map(|p| [p.cpu, p.rmse]).collect();
        series.push(Series { name: program.into(), points: unbeaten(points) });
    }
    Plot {
        name: format!("path-tracing-{scene}"),
        title: format!("{called}: relative RMSE against CPU time"),
        axes: ["CPU time, seconds".into(), "relative RMSE".into()],
        series,
    }
}

/// Points (time, error) to which there is none both faster and better, in order of time.
fn unbeaten(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let mut least = f64::INFINITY;
    points.retain(|p| {
        p[1] < least && {
            least = p[1];
            true
        }
    });
    points
}

/// Error against one setting, the others fixed; None if no run varies it.
fn against_setting(name: &str, axis: &str, of: fn(&Run) -> f64, runs: &[Run]) -> Option<Plot> {
    let curve = |(scene, called, _): (&str, &str, f64)| {
        let mut points: Vec<[f64; 2]> = runs
            .iter()
            .filter(|r| r.scene == scene && r.series.split(' ').any(|s| s == name))
            .map(|r| [of(r), r.rmse])
            .collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        (points.len() > 1).then(|| Series { name: called.into(), points })
    };
    let series: Vec<Series> = SCENES.into_iter().filter_map(curve).collect();
    (!series.is_empty()).then(|| Plot {
        name: format!("path-tracing-{name}"),
        title: format!("relative RMSE against {axis}"),
        axes: [axis.into(), "relative RMSE".into()],
        series,
    })
}

#[cfg(test)]
mod tests {
    use super::unbeaten;

    #[test]
    fn only_points_that_are_faster_or_better_than_all_others_stay() {
        let points = vec![[4.0, 0.1], [1.0, 0.5], [2.0, 0.6], [3.0, 0.2], [3.0, 0.3]];
        assert_eq!(unbeaten(points), [[1.0, 0.5], [3.0, 0.2], [4.0, 0.1]]);
    }
}
