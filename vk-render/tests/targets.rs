//! Sizes, errors, and the order in which things may be dropped.

mod common;

use common::{assert_valid, ball, camera, context, mesh_of};
use vk_render::{Context, ContextOptions, DeviceChoice, Error, Offscreen, Scene};

#[test]
fn another_size_is_another_picture_of_the_same() {
    let context = context();
    let (vertices, triangles) = ball(16);
    let mesh = mesh_of(&context, &vertices, &triangles);
    let mut target = Offscreen::new(&context, 64, 64).expect("a target");
    let first = target.draw(&Scene::new(&mesh, camera(64, 64))).expect("a picture");
    for (width, height) in [(200, 40), (1, 1), (33, 177), (64, 64)] {
        // One is in flight while the size changes.
        target.render(&Scene::new(&mesh, camera(64, 64))).expect("a picture");
        target.resize(width, height).expect("another size");
        assert_eq!(target.size(), (width, height));
        let image = target.draw(&Scene::new(&mesh, camera(width, height))).expect("a picture");
        assert_eq!((image.width, image.height), (width, height));
        assert_eq!(image.rgba.len(), 4 * (width * height) as usize);
    }
    let again = target.draw(&Scene::new(&mesh, camera(64, 64))).expect("a picture");
    assert!(first == again);
    assert_valid(&context);
}

#[test]
fn impossible_sizes_are_refused_and_the_target_stays_as_it_was() {
    let context = context();
    let mesh = mesh_of(&context, &[], &[]);
    for (width, height) in [(0, 10), (10, 0), (u32::MAX, 1)] {
        let refused = Offscreen::new(&context, width, height);
        assert!(matches!(refused, Err(Error::PictureSize { .. })), "{width} x {height}");
    }
    let mut target = Offscreen::new(&context, 8, 8).expect("a target");
    assert!(target.resize(0, 8).is_err());
    assert_eq!(target.size(), (8, 8));
    target.draw(&Scene::new(&mesh, camera(8, 8))).expect("a picture");
    assert_valid(&context);
}

#[test]
fn things_may_be_dropped_in_any_order_while_the_device_is_busy() {
    let (vertices, triangles) = ball(32);
    for order in 0..6 {
        let context = context();
        let mesh = mesh_of(&context, &vertices, &triangles);
        let mut target = Offscreen::new(&context, 256, 256).expect("a target");
        for _ in 0..3 {
            target.render(&Scene::new(&mesh, camera(256, 256))).expect("a picture");
        }
        let last = context.clone();
        match order {
            0 => drop((context, mesh, target)),
            1 => drop((context, target, mesh)),
            2 => drop((mesh, context, target)),
            3 => drop((mesh, target, context)),
            4 => drop((target, context, mesh)),
            _ => drop((target, mesh, context)),
        }
        assert_valid(&last);
    }
}

#[test]
fn several_targets_share_a_mesh_and_threads_share_a_context() {
    let context = context();
    let (vertices, triangles) = ball(16);
    std::thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| {
                let mesh = mesh_of(&context, &vertices, &triangles);
                let mut a = Offscreen::new(&context, 40, 40).expect("a target");
                let mut b = Offscreen::new(&context, 40, 40).expect("a target");
                for _ in 0..10 {
                    let scene = Scene::new(&mesh, camera(40, 40));
                    assert!(a.draw(&scene).expect("one") == b.draw(&scene).expect("other"));
                }
            });
        }
    });
    assert_valid(&context);
}

#[test]
fn a_device_is_chosen_by_name_or_place() {
    let name = context().device_name().to_owned();
    let mut options = ContextOptions::default();
    options.device = DeviceChoice::Name(name.to_uppercase());
    assert_eq!(Context::new(&options).expect("the same").device_name(), name);
    options.device = DeviceChoice::Software;
    match Context::new(&options) {
        Ok(context) => assert!(context.is_software()),
        // A machine may have nothing but a graphics card.
        Err(error) => assert!(matches!(error, Error::DeviceNotFound { .. }), "{error}"),
    }
    options.device = DeviceChoice::Index(0);
    Context::new(&options).expect("the first");
    for choice in [DeviceChoice::Index(1000), DeviceChoice::Name("no such card".into())] {
        options.device = choice;
        match Context::new(&options) {
            Err(Error::DeviceNotFound { available, .. }) => assert!(available.contains(&name)),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn one_sample_per_pixel_draws_too() {
    let mut options = ContextOptions::default();
    options.validation = true;
    options.max_samples = 1;
    let context = Context::new(&options).expect("a context");
    let (vertices, triangles) = ball(16);
    let mesh = mesh_of(&context, &vertices, &triangles);
    let mut target = Offscreen::new(&context, 64, 64).expect("a target");
    let image = target.draw(&Scene::new(&mesh, camera(64, 64))).expect("a picture");
    assert_ne!(image.pixel(32, 32), image.pixel(2, 32));
    assert_valid(&context);
}
