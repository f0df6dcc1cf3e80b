//! Curves over the number of triangles, as SVG.

use std::fs;
use std::path::Path;

use plotters::prelude::*;

use crate::Error;

/// What was measured at each size.
#[derive(Debug, Clone)]
pub struct Curve {
    /// What it is called in the legend.
    pub name: String,
    /// Triangles, and what was measured.
    pub points: Vec<(f64, f64)>,
}

const WIDTH: u32 = 900;
const HEIGHT: u32 = 300;
const COLOURS: [RGBColor; 3] =
    [RGBColor(0x1f, 0x77, 0xb4), RGBColor(0xd6, 0x5f, 0x0e), RGBColor(0x2c, 0x8a, 0x3c)];

/// Writes charts below each other, each with its title and curves.
pub fn write(file: &Path, charts: &[(&str, Vec<Curve>)]) -> Result<(), Error> {
    let mut svg = String::new();
    let drawn = draw(&mut svg, charts);
    drawn.map_err(|error| Error::Report {
        what: file.display().to_string(),
        why: error.to_string(),
    })?;
    fs::write(file, svg).map_err(Error::file(file))
}

fn draw(svg: &mut String, charts: &[(&str, Vec<Curve>)]) -> Result<(), Box<dyn std::error::Error>> {
    let root =
        SVGBackend::with_string(svg, (WIDTH, HEIGHT * charts.len() as u32)).into_drawing_area();
    root.fill(&WHITE).map_err(|error| error.to_string())?;
    for (area, (title, curves)) in root.split_evenly((charts.len(), 1)).iter().zip(charts) {
        chart(area, title, curves)?;
    }
    root.present().map_err(|error| error.to_string())?;
    Ok(())
}

fn chart<B: DrawingBackend>(
    area: &DrawingArea<B, plotters::coord::Shift>,
    title: &str,
    curves: &[Curve],
) -> Result<(), Box<dyn std::error::Error>>
where
    B::ErrorType: 'static,
{
    let points = || curves.iter().flat_map(|curve| &curve.points).filter(|p| p.1.is_finite());
    let least = points().map(|p| p.0).fold(f64::INFINITY, f64::min).min(1e6);
    let most = points().map(|p| p.0).fold(least * 2.0, f64::max);
    let top = 1.15 * points().map(|p| p.1).fold(f64::MIN_POSITIVE, f64::max);
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(34)
        .y_label_area_size(60)
        .build_cartesian_2d((least..most).log_scale(), 0.0..top)?;
    chart
        .configure_mesh()
        .x_desc("triangles")
        .x_label_formatter(&|x| format!("{:.1} M", x / 1e6))
        .light_line_style(WHITE)
        .draw()?;
    for (curve, colour) in curves.iter().zip(COLOURS.iter().cycle()) {
        let shown = || curve.points.iter().copied().filter(|p| p.1.is_finite());
        chart
            .draw_series(LineSeries::new(shown(), colour.stroke_width(2)))?
            .label(&curve.name)
            .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
        chart.draw_series(shown().map(|p| Circle::new(p, 3, colour.filled())))?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.3))
        .draw()?;
    Ok(())
}
