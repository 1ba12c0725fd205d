//! Diagrams with logarithmic axes, as SVG.

use anyhow::{Result, anyhow};
use plotters::prelude::*;

/// A diagram: curves over logarithmic axes.
#[derive(Clone, Debug)]
pub struct Plot {
    /// File name without ending, and caption.
    pub name: String,
    /// Heading.
    pub title: String,
    /// What the axes show, with units.
    pub axes: [String; 2],
    /// Curves.
    pub series: Vec<Series>,
}

/// A curve.
#[derive(Clone, Debug)]
pub struct Series {
    /// Name for the legend.
    pub name: String,
    /// Points (x, y), both positive.
    pub points: Vec<[f64; 2]>,
}

/// A number at an axis, without the digits that binary fractions add.
fn label(value: &f64) -> String {
    format!("{value:.3e}").parse::<f64>().unwrap_or(*value).to_string()
}

const SIZE: (u32, u32) = (760, 460);

impl Plot {
    /// The diagram as SVG text. Points that are not positive cannot be shown on logarithmic axes and are an error.
    pub fn svg(&self) -> Result<String> {
        let (x, y) = (self.range(0)?, self.range(1)?);
        let mut text = String::new();
        self.draw(&mut text, x, y).map_err(|error| anyhow!("{}: {error}", self.name))?;
        Ok(text)
    }

    fn draw(&self, text: &mut String, x: [f64; 2], y: [f64; 2]) -> Result<(), Box<dyn std::error::Error + '_>> {
        let area = SVGBackend::with_string(text, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .caption(&self.title, ("sans-serif", 18))
            .margin(12)
            .x_label_area_size(44)
            .y_label_area_size(64)
            .build_cartesian_2d((x[0]..x[1]).log_scale(), (y[0]..y[1]).log_scale())?;
        chart
            .configure_mesh()
            .x_desc(&self.axes[0])
            .y_desc(&self.axes[1])
            .x_label_formatter(&label)
            .y_label_formatter(&label)
            .light_line_style(WHITE)
            .draw()?;
        for (k, series) in self.series.iter().enumerate() {
            let colour = Palette99::pick(k).to_rgba();
            let points = || series.points.iter().map(|p| (p[0], p[1]));
            chart
                .draw_series(LineSeries::new(points(), colour.stroke_width(2)))?
                .label(&series.name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
            chart.draw_series(points().map(|p| Circle::new(p, 3, colour.filled())))?;
        }
        chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK.mix(0.3)).draw()?;
        area.present()?;
        Ok(())
    }

    /// Smallest and largest value of an axis, with some room.
    fn range(&self, axis: usize) -> Result<[f64; 2]> {
        let values = || self.series.iter().flat_map(|s| &s.points).map(|p| p[axis]);
        if values().next().is_none() || values().any(|v| !(v > 0.0 && v.is_finite())) {
            return Err(anyhow!("{}: logarithmic axes need positive values", self.name));
        }
        Ok([values().fold(f64::INFINITY, f64::min) / 1.3, values().fold(0.0, f64::max) * 1.3])
    }
}
