//! Curves over the number of triangles or over time, as SVG.

use std::fs;
use std::path::Path;

use plotters::coord::Shift;
use plotters::coord::ranged1d::ValueFormatter;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use crate::Error;

/// What was measured at each place.
#[derive(Debug, Clone)]
pub struct Curve {
    /// What it is called in the legend.
    pub name: String,
    /// Places, and what was measured.
    pub points: Vec<(f64, f64)>,
}

/// What the curves of a chart run over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Over {
    /// Numbers of triangles, on a logarithmic scale.
    Triangles,
    /// Seconds.
    Seconds,
}

/// Some curves with a title.
#[derive(Debug, Clone)]
pub struct Chart {
    /// What is shown, and in which unit.
    pub title: String,
    /// What the curves run over.
    pub over: Over,
    /// The curves.
    pub curves: Vec<Curve>,
}

type Drawn = Result<(), Box<dyn std::error::Error>>;

const WIDTH: u32 = 900;
const HEIGHT: u32 = 300;
const COLOURS: [RGBColor; 3] =
    [RGBColor(0x1f, 0x77, 0xb4), RGBColor(0xd6, 0x5f, 0x0e), RGBColor(0x2c, 0x8a, 0x3c)];

/// Writes charts below each other, each with its title and curves.
///
/// # Errors
/// When the file cannot be written.
pub fn write(file: &Path, charts: &[Chart]) -> Result<(), Error> {
    let mut svg = String::new();
    let drawn = draw(&mut svg, charts);
    drawn.map_err(|error| Error::Report {
        what: file.display().to_string(),
        why: error.to_string(),
    })?;
    fs::write(file, svg).map_err(Error::file(file))
}

fn draw(svg: &mut String, charts: &[Chart]) -> Drawn {
    let root =
        SVGBackend::with_string(svg, (WIDTH, HEIGHT * charts.len() as u32)).into_drawing_area();
    root.fill(&WHITE).map_err(|error| error.to_string())?;
    for (area, chart) in root.split_evenly((charts.len(), 1)).iter().zip(charts) {
        draw_chart(area, chart)?;
    }
    root.present().map_err(|error| error.to_string())?;
    Ok(())
}

fn draw_chart<B: DrawingBackend>(area: &DrawingArea<B, Shift>, chart: &Chart) -> Drawn
where
    B::ErrorType: 'static,
{
    let points = || chart.curves.iter().flat_map(|curve| &curve.points).filter(|p| p.1.is_finite());
    let top = 0.0..1.4 * points().map(|p| p.1).fold(f64::MIN_POSITIVE, f64::max);
    let last = points().map(|p| p.0).fold(f64::MIN_POSITIVE, f64::max);
    let mut builder = ChartBuilder::on(area);
    builder.caption(&chart.title, ("sans-serif", 18)).margin(12).margin_right(32);
    builder.x_label_area_size(34).y_label_area_size(60);
    match chart.over {
        Over::Triangles => {
            let least = points().map(|p| p.0).fold(1e6, f64::min);
            let across = (least..last.max(least * 2.0)).log_scale();
            let millions = |x: &f64| format!("{:.1} M", x / 1e6);
            let context = builder.build_cartesian_2d(across, top)?;
            draw_curves(context, chart, ("triangles", &millions))
        }
        Over::Seconds => {
            let context = builder.build_cartesian_2d(0.0..last, top)?;
            draw_curves(context, chart, ("seconds", &|x| format!("{x:.0}")))
        }
    }
}

fn draw_curves<'a, B: DrawingBackend + 'a, X: Ranged<ValueType = f64> + ValueFormatter<f64>>(
    mut context: ChartContext<'a, B, Cartesian2d<X, RangedCoordf64>>,
    chart: &Chart,
    (name, label): (&str, &dyn Fn(&f64) -> String),
) -> Drawn
where
    B::ErrorType: 'static,
{
    let mut mesh = context.configure_mesh();
    mesh.x_desc(name).x_label_formatter(&label).light_line_style(WHITE).draw()?;
    for (curve, colour) in chart.curves.iter().zip(COLOURS.iter().cycle()) {
        let shown = || curve.points.iter().copied().filter(|p| p.1.is_finite());
        context
            .draw_series(LineSeries::new(shown(), colour.stroke_width(2)))?
            .label(&curve.name)
            .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
        context.draw_series(shown().map(|p| Circle::new(p, 3, colour.filled())))?;
    }
    context
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.3))
        .draw()?;
    Ok(())
}
