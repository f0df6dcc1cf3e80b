use std::time::Instant;
use xfm_format::*;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let file = XfmFile::open(&args[1]).unwrap();
    let forest = file.read_forest().unwrap();
    let mut options = WriteOptions::default();
    options.encoding = Encoding::Compact;
    options.position_error = PositionError::OfDiagonal(args[2].parse().unwrap());
    if let Some(n) = args.get(3) { options.page_nodes = n.parse().unwrap(); }
    let out = "/tmp/cx/out.xfm";
    let t = Instant::now();
    let report = match write(&forest, out, &options) { Ok(r) => r, Err(e) => { println!("{e}"); return; } };
    println!("write {:?}", t.elapsed());
    let f = XfmFile::open(out).unwrap();
    let n = f.header().nodes as f64;
    for (name, b) in report.bytes.iter() { println!("{name:10} {b:9} {:7.3} bits/node {:6.3} B/tri", b as f64 * 8.0 / n, b as f64 / f.header().input_triangles as f64); }
    println!("total {} {:.3} B/tri, {} pages", report.file_bytes, report.file_bytes as f64 / f.header().input_triangles as f64, report.pages);
    let mut reader = f.page_reader().unwrap();
    let mut page = Page::new();
    let mut best = f64::MAX;
    for _ in 0..(if args.get(4).is_some() {40} else {5}) {
        let t = Instant::now();
        for p in 0..f.num_pages() { f.read_page_into(p, &mut reader, &mut page).unwrap(); }
        best = best.min(t.elapsed().as_secs_f64());
    }
    println!("decode {:.2} M nodes/s, {:.1} us/page", n / best / 1e6, best * 1e6 / f.num_pages() as f64);
    assert_eq!(f.field_bytes().unwrap(), report.bytes);
    if args.get(4).is_none() { let v = verify(&f, |_| {}); println!("errors {} {:?}", v.errors.len() + v.more, v.errors.first()); }
}
