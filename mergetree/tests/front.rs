//! Fronts moved at random, against the naive specification, with every invariant checked after every step.

mod common;

use common::{forest, naive_mesh, random_records, small, sorted_triangles};
use glam::Vec3;
use halfedge::HalfEdgeMesh;
use mergetree::{
    BuildOptions, Dependencies, Forest, Front, HalfEdgeName, NodeId, NodeStore, Records,
    UpdateLimits, collapse_in_independent_sets, ranks,
};
use proptest::prelude::*;
use proptest::sample::Index;

fn split_set(forest: &Forest) -> Vec<bool> {
    forest.nodes.iter().map(|n| n.slot.is_some()).collect()
}

fn id(pick: &Index, forest: &Forest) -> NodeId {
    NodeId::from_index(pick.index(forest.nodes.len()))
}

fn stand_ranks_for_orders(forest: &mut Forest) {
    let ranks = ranks(forest).unwrap();
    for (node, rank) in forest.nodes.iter_mut().zip(ranks) {
        node.order = rank;
    }
}

fn euler(triangles: &[[u32; 3]], num_vertices: usize) -> i64 {
    let mesh = HalfEdgeMesh::from_triangles(num_vertices, triangles).unwrap();
    let boundary = mesh.half_edges().filter(|&h| mesh.reverse(h).is_none()).count();
    num_vertices as i64 - (3 * triangles.len() + boundary) as i64 / 2 + triangles.len() as i64
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..Default::default() })]

    #[test]
    fn random_splits_and_collapses_keep_every_invariant(
        which in 0usize..5,
        collapses in prop::collection::vec(any::<Index>(), 0..200),
        steps in prop::collection::vec((any::<bool>(), any::<Index>()), 1..80),
        order in any::<bool>(),
        ranked in any::<bool>(),
    ) {
        let shape = &small()[which];
        let records = random_records(shape, &collapses);
        let mut forest = forest(shape, &records);
        prop_assume!(!forest.nodes.is_empty());
        if ranked {
            stand_ranks_for_orders(&mut forest);
        }
        let dependencies = if order { Dependencies::Order } else { Dependencies::Links };
        let mut front = Front::new(&forest, dependencies).unwrap();
        let topology = euler(&shape.triangles, shape.positions.len());
        for (split, pick) in &steps {
            let id = id(pick, &forest);
            if *split {
                front.split(&mut forest, id, 0.0).unwrap();
                prop_assert!(forest.nodes[id.index()].slot.is_some());
            } else if front.collapse(&mut forest, id).is_ok() {
                prop_assert!(forest.nodes[id.index()].slot.is_none());
            }
            prop_assert_eq!(front.validate(&forest), Ok(()));
            let mesh = front.to_mesh();
            prop_assert_eq!(euler(&mesh.1, mesh.0.len()), topology);
            let expected = naive_mesh(shape, &records.records, &split_set(&forest));
            prop_assert_eq!(sorted_triangles(mesh), expected, "{}", shape.name);
        }
        // All the way down is the input, all the way up the coarsest mesh.
        front.update(&mut forest, |_| 1.0, &UpdateLimits::with_tolerance(0.0));
        let full = naive_mesh(shape, &[], &[]);
        prop_assert_eq!(sorted_triangles(front.to_mesh()), full);
        front.update(&mut forest, |_| 0.0, &UpdateLimits::with_tolerance(1.0));
        prop_assert_eq!(front.num_split_nodes(), 0);
        prop_assert_eq!(front.validate(&forest), Ok(()));
    }

    #[test]
    fn the_mesh_depends_on_the_split_set_alone(
        which in 0usize..5,
        collapses in prop::collection::vec(any::<Index>(), 0..200),
        wanted in prop::collection::vec(any::<Index>(), 1..25),
        detours in prop::collection::vec(any::<Index>(), 0..25),
    ) {
        let shape = &small()[which];
        let records = random_records(shape, &collapses);
        let mut first = forest(shape, &records);
        prop_assume!(!first.nodes.is_empty());
        let mut second = first.clone();
        let mut a = Front::new(&first, Dependencies::Links).unwrap();
        for pick in &wanted {
            let id = id(pick, &first);
            a.split(&mut first, id, 0.0).unwrap();
        }
        // The same nodes backwards, with detours that are taken back as far as that goes.
        let mut b = Front::new(&second, Dependencies::Links).unwrap();
        for pick in wanted.iter().rev().chain(&detours) {
            let id = id(pick, &second);
            b.split(&mut second, id, 0.0).unwrap();
        }
        let target = split_set(&first);
        loop {
            let extra = (0..target.len()).find(|&i| {
                second.nodes[i].slot.is_some()
                    && !target[i]
                    && b.collapse(&mut second, NodeId::from_index(i)).is_ok()
            });
            if extra.is_none() {
                break;
            }
        }
        prop_assert_eq!(split_set(&second), target);
        prop_assert_eq!(sorted_triangles(a.to_mesh()), sorted_triangles(b.to_mesh()));
    }

    #[test]
    fn ranks_are_those_that_records_have_and_in_the_order_of_dependencies(
        which in 0usize..5,
        collapses in prop::collection::vec(any::<Index>(), 0..200),
        sets in any::<bool>(),
    ) {
        let shape = &small()[which];
        let records = if sets {
            let options = { let mut o = BuildOptions::default(); o.base_faces = 4; o };
            collapse_in_independent_sets(shape.mesh(), &shape.positions, &shape.normals(), &options, &|_| ())
        } else {
            random_records(shape, &collapses)
        };
        let forest = forest(shape, &records);
        let ranks = ranks(&forest).unwrap();
        let noted: Vec<_> = records.records.iter().map(|record| record.rank).collect();
        prop_assert_eq!(&noted, &ranks.iter().copied().map(Some).collect::<Vec<_>>());
        let names = forest.base.names();
        for (node, &rank) in forest.nodes.iter().zip(&ranks) {
            prop_assert!(rank <= node.order);
            for child in node.children() {
                prop_assert!(ranks[child.index()] < rank);
            }
            for name in node.adjacent.into_iter().flatten() {
                if let HalfEdgeName::Node(owner, _) = names.resolve(name) {
                    prop_assert!(ranks[owner.index()] > rank);
                }
            }
        }
    }

    #[test]
    fn with_orders_no_triangle_is_one_the_build_did_not_make(
        which in 0usize..5,
        ranked in any::<bool>(),
        steps in prop::collection::vec((any::<bool>(), any::<Index>()), 1..120),
    ) {
        let shape = &small()[which];
        let normals = shape.normals();
        let options = { let mut o = BuildOptions::default(); o.base_faces = 4; o };
        let records = collapse_in_independent_sets(shape.mesh(), &shape.positions, &normals, &options, &|_| ());
        // Every triangle of every mesh of the sequence.
        let mut made = std::collections::BTreeSet::new();
        let mut split = vec![true; records.records.len()];
        for order in 0..=records.records.len() {
            made.extend(
                naive_mesh(shape, &records.records, &split)
                    .into_iter()
                    .map(|t| t.map(|p| p.to_array().map(f32::to_bits))),
            );
            if order < split.len() {
                split[order] = false;
            }
        }
        let mut forest = forest(shape, &records);
        prop_assume!(!forest.nodes.is_empty());
        if ranked {
            stand_ranks_for_orders(&mut forest);
        }
        let mut front = Front::new(&forest, Dependencies::Order).unwrap();
        for (split, pick) in &steps {
            let id = id(pick, &forest);
            if *split {
                front.split(&mut forest, id, 0.0).unwrap();
            } else {
                // Refused as often as not.
                front.collapse(&mut forest, id).ok();
            }
            prop_assert_eq!(front.validate(&forest), Ok(()));
            for t in sorted_triangles(front.to_mesh()) {
                let key = t.map(|p| p.to_array().map(f32::to_bits));
                prop_assert!(made.contains(&key), "{} {:?}", shape.name, t);
            }
        }
    }

    #[test]
    fn what_changed_is_all_that_changed(
        which in 0usize..5,
        collapses in prop::collection::vec(any::<Index>(), 0..200),
        steps in prop::collection::vec((any::<bool>(), any::<Index>()), 1..60),
    ) {
        let shape = &small()[which];
        let mut forest = forest(shape, &random_records(shape, &collapses));
        prop_assume!(!forest.nodes.is_empty());
        let mut front = Front::new(&forest, Dependencies::Links).unwrap();
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        for (split, pick) in &steps {
            let id = id(pick, &forest);
            if *split {
                front.split(&mut forest, id, 0.0).unwrap();
            } else {
                front.collapse(&mut forest, id).ok();
            }
            let changes = front.take_changes();
            vertices.resize(front.vertices().len(), Default::default());
            triangles.resize(front.triangles().len(), [0; 3]);
            for range in changes.vertices {
                let range = range.start as usize..range.end as usize;
                vertices[range.clone()].copy_from_slice(&front.vertices()[range]);
            }
            for range in changes.triangles {
                let range = range.start as usize..range.end as usize;
                triangles[range.clone()].copy_from_slice(&front.triangles()[range]);
            }
            prop_assert_eq!(&vertices[..], front.vertices());
            prop_assert_eq!(&triangles[..], front.triangles());
        }
    }
}

#[test]
fn an_update_settles() {
    let shape = common::torus(60, 30);
    let mut forest =
        mergetree::build(shape.mesh(), &shape.positions, &BuildOptions::default(), &|_| ())
            .unwrap();
    for dependencies in [Dependencies::Links, Dependencies::Order] {
        let mut front = Front::new(&forest, dependencies).unwrap();
        for tolerance in [0.05, 0.005, 0.02, 0.001] {
            let limits = UpdateLimits::with_tolerance(tolerance);
            front.update(&mut forest, |n| n.deviation, &limits);
            front.validate(&forest).unwrap();
            assert!(
                forest.nodes.iter().all(|n| n.slot.is_some() || n.deviation <= tolerance),
                "all that is too coarse was split"
            );
            let again = front.update(&mut forest, |n| n.deviation, &limits);
            assert_eq!((again.splits, again.collapses), (0, 0), "{dependencies:?} {tolerance}");
        }
        front.update(&mut forest, |_| 0.0, &UpdateLimits::default());
        assert_eq!(front.num_split_nodes(), 0);
    }
}

#[test]
fn a_triangle_limit_is_held_but_for_what_one_split_forces() {
    let shape = common::torus(60, 30);
    let mut forest =
        mergetree::build(shape.mesh(), &shape.positions, &BuildOptions::default(), &|_| ())
            .unwrap();
    let mut front = Front::new(&forest, Dependencies::Links).unwrap();
    let mut limits = UpdateLimits::with_tolerance(0.0);
    limits.max_triangles = 1000;
    front.update(&mut forest, |n| n.deviation, &limits);
    assert!((1000..1200).contains(&front.num_triangles()), "{}", front.num_triangles());
}

#[test]
fn a_node_that_contradicts_its_surroundings_changes_nothing() {
    let shape = common::sheet(6, 6);
    let whole = forest(&shape, &random_records(&shape, &[]));
    let mut rejected = 0;
    for node in 0..whole.nodes.len() {
        for which in 0..4 {
            for wrong in
                [None, Some(halfedge::HalfEdgeId::new(1)), Some(halfedge::HalfEdgeId::new(40))]
            {
                let mut forest = whole.clone();
                forest.nodes[node].adjacent[which] = wrong;
                let mut front = Front::new(&forest, Dependencies::Links).unwrap();
                for id in (0..forest.nodes.len()).rev() {
                    if front.split(&mut forest, NodeId::from_index(id), 0.0).is_err() {
                        rejected += 1;
                    }
                }
                front.validate(&forest).unwrap();
            }
        }
    }
    assert!(rejected > 100);
}

/// A tree that two vertices claim is split where the one is and still to come where the other is: refinement waited for it
/// forever.
#[test]
fn a_tree_of_two_vertices_is_damage_and_no_endless_loop() {
    let mut damaged = 0;
    let shape = common::torus(12, 8);
    let mut options = BuildOptions::default();
    options.base_faces = 16;
    let whole = mergetree::build(shape.mesh(), &shape.positions, &options, &|_| ()).unwrap();
    let vertices = 0..whole.base.vertices.len();
    for (from, to) in vertices.clone().flat_map(|from| vertices.clone().map(move |to| (from, to))) {
        let mut forest = whole.clone();
        forest.base.vertices[to].root = forest.base.vertices[from].root;
        let mut front = Front::new(&forest, Dependencies::Order).unwrap();
        let stats = front.update(&mut forest, |_| 1.0, &UpdateLimits::with_tolerance(0.0));
        assert!(from != to || stats.damaged == 0);
        damaged += stats.damaged;
    }
    assert!(damaged > 0);
}

#[test]
fn bounds_hold_all_that_is_below() {
    let shape = common::torus(40, 20);
    let normals = shape.normals();
    let records = collapse_in_independent_sets(
        shape.mesh(),
        &shape.positions,
        &normals,
        &BuildOptions::default(),
        &|_| (),
    );
    let forest = forest(&shape, &records);
    for node in &forest.nodes {
        for child in node.children().map(|c| &forest.nodes[c.index()]) {
            assert!(
                node.position.distance(child.position) + child.radius <= node.radius * 1.000_001
            );
            assert!(child.deviation <= node.deviation);
            assert!(child.order < node.order);
            let angle = node.normal.to_vec3().angle_between(child.normal.to_vec3());
            assert!(
                node.cone_sine == 1.0
                    || angle + child.cone_sine.asin() <= node.cone_sine.asin() + 1e-4
            );
        }
    }
    assert_eq!(forest.num_input_faces(), shape.triangles.len());
    assert!(forest.depth() as f32 <= 3.0 * (forest.nodes.len() as f32).log2());
    assert_eq!(
        forest.base().roots().count(),
        forest.nodes.iter().filter(|n| n.parent.is_none()).count()
    );
}

#[test]
fn closed_surfaces_turned_inside_out_are_known_and_open_ones_are_not_judged() {
    // Collapsed with regard to geometry: the coarsest mesh has the shape of the input.
    let is_inside_out = |shape: &common::Shape| {
        let options = BuildOptions::default();
        let forest = mergetree::build(shape.mesh(), &shape.positions, &options, &|_| ()).unwrap();
        forest.base.is_inside_out()
    };
    let turned = |mut shape: common::Shape| {
        shape.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        shape
    };
    assert!(!is_inside_out(&common::sphere(3)));
    assert!(is_inside_out(&turned(common::sphere(3))));
    let torus = common::torus(40, 20);
    assert_ne!(is_inside_out(&torus), is_inside_out(&turned(torus)));
    let sheet = common::sheet(9, 9);
    assert!(!is_inside_out(&sheet) && !is_inside_out(&turned(sheet)));
}

#[test]
fn colours_follow_their_vertices() {
    let shape = common::torus(24, 16);
    let (positions, normals) = (&shape.positions, shape.normals());
    let Records { records, coarse } = collapse_in_independent_sets(
        shape.mesh(),
        positions,
        &normals,
        &BuildOptions::default(),
        &|_| (),
    );
    let colour = |p: Vec3| {
        let [r, g, b] = p.to_array().map(|c| (c * 50.0) as i8 as u8);
        [r, g, b, r ^ g]
    };
    let colours: Vec<_> = positions.iter().map(|&p| colour(p)).collect();
    let plain = Forest::from_records(&records, &coarse, positions, &normals).unwrap();
    assert!(Front::new(&plain, Dependencies::Order).unwrap().to_colours().is_empty());
    let mut forest = plain.with_colours(&records, &coarse, &colours);
    let mut front = Front::new(&forest, Dependencies::Order).unwrap();
    // Finer, coarser so that places become free, and finer again.
    for tolerance in [0.1, 1.0, 0.01, 0.3, 0.0] {
        let limits = UpdateLimits::with_tolerance(tolerance);
        front.update(&mut forest, |node| node.deviation.max(1e-9), &limits);
        assert_eq!(front.colours().len(), front.vertices().len());
        let expected: Vec<_> = front.to_mesh().0.into_iter().map(colour).collect();
        assert_eq!(front.to_colours(), expected);
    }
    assert_eq!(front.to_colours().len(), positions.len());
}
