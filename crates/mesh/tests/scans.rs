//! Volumes from files: what is read, what is refused and in which words, and what a drill feels of a scan.

use std::f64::consts::PI;

use teleclay_clay::{
    Clay, Coefficients, ContactState, Grid, Material, Motion, Pose, Tool, ToolShape,
};
use teleclay_mesh::volume::MOST_SAMPLE_BYTES;
use teleclay_mesh::{
    Placement, Thresholds, Volume, VolumeError, fill_volume, read_metaimage, read_nrrd,
};

fn material(viscosity: f64, yield_stress: f64) -> Material {
    Material::new(Coefficients {
        viscosity_pa_s_per_m: viscosity,
        yield_stress_pa: yield_stress,
        stiffness_pa: 0.0,
    })
    .unwrap()
}

/// Samples of two bytes, little: whatever `value` says of each place.
fn samples(sizes: [usize; 3], value: impl Fn([usize; 3]) -> i16) -> Vec<u8> {
    let mut bytes = Vec::new();
    for z in 0..sizes[2] {
        for y in 0..sizes[1] {
            for x in 0..sizes[0] {
                bytes.extend_from_slice(&value([x, y, z]).to_le_bytes());
            }
        }
    }
    bytes
}

fn nrrd(fields: &str, data: &[u8]) -> Vec<u8> {
    let mut file = format!("NRRD0004\n# a scan\n{fields}\n\n").into_bytes();
    file.extend_from_slice(data);
    file
}

fn short_nrrd(sizes: [usize; 3], more: &str, data: &[u8]) -> Vec<u8> {
    let [x, y, z] = sizes;
    nrrd(
        &format!("type: short\ndimension: 3\nsizes: {x} {y} {z}\nendian: little\n{more}"),
        data,
    )
}

/// A file of gzip with one member.
fn gzip(data: &[u8]) -> Vec<u8> {
    let mut file = vec![0x1F, 0x8B, 8, 8, 0, 0, 0, 0, 0, 3];
    file.extend_from_slice(b"scan.raw\0");
    file.extend_from_slice(&miniz_oxide::deflate::compress_to_vec(data, 6));
    file.extend_from_slice(&rawzip::crc32(data).to_le_bytes());
    file.extend_from_slice(&(data.len() as u32).to_le_bytes());
    file
}

/// Every value tells where it is.
fn placed([x, y, z]: [usize; 3]) -> i16 {
    (x + 10 * y + 100 * z) as i16 - 50
}

fn assert_placed(volume: &Volume) {
    let [nx, ny, nz] = volume.sizes();
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let (got, want) = (volume.sample([x, y, z]), f64::from(placed([x, y, z])));
                assert!((got - want).abs() < 1e-12, "{x} {y} {z}: {got}, {want}");
            }
        }
    }
}

const SIZES: [usize; 3] = [4, 5, 3];

#[test]
fn the_same_volume_comes_from_every_form_of_file() {
    let data = samples(SIZES, placed);
    let big: Vec<u8> = data
        .as_chunks::<2>()
        .0
        .iter()
        .flat_map(|[a, b]| [*b, *a])
        .collect();
    let floats: Vec<u8> = data
        .as_chunks::<2>()
        .0
        .iter()
        .flat_map(|two| f32::from(i16::from_le_bytes(*two)).to_be_bytes())
        .collect();
    let mha = |more: &str, data: &[u8]| {
        let mut file = format!(
            "ObjectType = Image\nNDims = 3\nBinaryData = True\nDimSize = 4 5 3\nElementSpacing = 1 2 3\n{more}\nElementDataFile = LOCAL\n"
        )
        .into_bytes();
        file.extend_from_slice(data);
        file
    };
    let packed = miniz_oxide::deflate::compress_to_vec_zlib(&data, 6);
    let with_spacings = "encoding: raw\nspacings: 1 2 3";
    let volumes = [
        read_nrrd(&short_nrrd(SIZES, with_spacings, &data)),
        read_nrrd(&short_nrrd(
            SIZES,
            "encoding: gzip\nspacings: 1 2 3",
            &gzip(&data),
        )),
        read_nrrd(&short_nrrd(
            SIZES,
            "encoding: raw\nspace: left-posterior-superior\nspace directions: (1,0,0) (0,2,0) (0,0,3)\nspace origin: (7,8,9)\nkinds: domain domain domain\nwindow:=lung",
            &data,
        )),
        read_nrrd(&short_nrrd(
            SIZES,
            "encoding: raw\nspacings: 0.1 0.2 0.3\nspace units: \"cm\" \"cm\" \"cm\"",
            &data,
        )),
        read_nrrd(&nrrd(
            "type: int16\r\ndimension: 3\r\nsizes: 4 5 3\r\nendian: big\r\nencoding: raw\r\nspacings: 1 2 3\r",
            &big,
        )),
        read_nrrd(&nrrd(
            "type: float\ndimension: 3\nsizes: 4 5 3\nendian: big\nencoding: raw\nspacings: 1 2 3",
            &floats,
        )),
        read_metaimage(&mha("ElementType = MET_SHORT", &data)),
        read_metaimage(&mha(
            "BinaryDataByteOrderMSB = True\nElementType = MET_SHORT",
            &big,
        )),
        read_metaimage(&mha(
            "CompressedData = True\nElementType = MET_SHORT",
            &packed,
        )),
        read_metaimage(&mha(
            "TransformMatrix = 1 0 0 0 1 0 0 0 1\nElementType = MET_SHORT",
            &data,
        )),
    ];
    for volume in volumes {
        let volume = volume.unwrap();
        assert_eq!(volume.sizes(), SIZES);
        for (got_m, want_m) in volume.spacing_m().into_iter().zip([1e-3, 2e-3, 3e-3]) {
            assert!((got_m - want_m).abs() < 1e-12);
        }
        assert_placed(&volume);
    }
}

#[test]
fn axes_in_another_order_and_the_other_way_are_put_right() {
    // The file runs along z first, backwards; then along x; then along y, backwards.
    let [nx, ny, nz] = SIZES;
    let mut data = Vec::new();
    for j in 0..ny {
        for i in 0..nx {
            for k in 0..nz {
                data.extend_from_slice(&placed([i, ny - 1 - j, nz - 1 - k]).to_le_bytes());
            }
        }
    }
    let file = short_nrrd(
        [nz, nx, ny],
        "encoding: raw\nspace directions: (0,0,-3) (1,1e-12,0) (0,-2,0)",
        &data,
    );
    let volume = read_nrrd(&file).unwrap();
    assert_eq!(volume.sizes(), SIZES);
    assert_placed(&volume);
}

#[test]
fn what_is_not_read_is_refused_in_words() {
    let data = samples(SIZES, placed);
    let raw = "encoding: raw\nspacings: 1 2 3";
    let cases: Vec<(Vec<u8>, &str)> = vec![
        (b"NRRD0009\n\n".to_vec(), "NRRD0001 to NRRD0005"),
        (b"NRRD0004\ntype: short\n".to_vec(), "detached header"),
        (
            short_nrrd(SIZES, &format!("{raw}\ndata file: scan.raw"), &data),
            "detached header is not read",
        ),
        (
            short_nrrd(SIZES, &format!("{raw}\nbyte skip: 4"), &data),
            "right behind the header",
        ),
        (
            short_nrrd(SIZES, "encoding: bzip2\nspacings: 1 2 3", &data),
            "wanted raw or gzip",
        ),
        (
            short_nrrd(SIZES, "encoding: raw\nspacings: 1 nan 3", &data),
            "oblique",
        ),
        (
            short_nrrd(SIZES, "encoding: raw\nspacings: 1 inf 3", &data),
            "oblique",
        ),
        (
            short_nrrd(SIZES, "encoding: raw\nspacings: 1 0 3", &data),
            "oblique",
        ),
        (
            short_nrrd(SIZES, "encoding: raw\nspacings: 1 1e-9 3", &data),
            "apart along axis 1",
        ),
        (
            short_nrrd(SIZES, "encoding: raw\nspacings: 1 1e9 3", &data),
            "apart along axis 1",
        ),
        (
            short_nrrd(
                SIZES,
                "encoding: raw\nspace directions: (1,0.1,0) (0,2,0) (0,0,3)",
                &data,
            ),
            "oblique volumes are not read",
        ),
        (
            short_nrrd(
                SIZES,
                "encoding: raw\nspace directions: (1,0,0) (2,0,0) (0,0,3)",
                &data,
            ),
            "two axes run along x",
        ),
        (
            short_nrrd(SIZES, "encoding: raw", &data),
            "neither spacings nor space directions",
        ),
        (short_nrrd([4, 0, 3], raw, &data), "axis 1 has no samples"),
        (
            short_nrrd(SIZES, raw, &data[1..]),
            "speaks of 120 bytes of samples, there are 119",
        ),
        (
            short_nrrd(SIZES, &format!("{raw}\nspacings: 1 2 3"), &data),
            "told twice",
        ),
        (nrrd("type: block\ndimension: 3", &data), "a type of number"),
        (
            nrrd("type: short\ndimension: 4\nsizes: 4 5 3", &data),
            "the dimension is 4, wanted 3",
        ),
        (
            nrrd(
                &format!("type: short\ndimension: 3\nsizes: 4 5 3\n{raw}"),
                &data,
            ),
            "endian is not told",
        ),
        (
            nrrd(
                &format!("type: short\ndimension: 3\nsizes: 4 5 3 1\nendian: little\n{raw}"),
                &data,
            ),
            "three numbers",
        ),
        (
            nrrd(
                &format!("type: short\ndimension: 3\nsizes: 4 -5 3\nendian: little\n{raw}"),
                &data,
            ),
            "a whole number",
        ),
        (nrrd("no field", &data), "a line that is no field"),
    ];
    for (file, want) in cases {
        let said = read_nrrd(&file).unwrap_err().to_string();
        assert!(said.contains(want), "{said:?}, wanted {want:?}");
    }
    let mha = |lines: &str| {
        format!("ObjectType = Image\nNDims = 3\nDimSize = 1 1 1\nElementSpacing = 1 1 1\nElementType = MET_UCHAR\n{lines}").into_bytes()
    };
    let cases: Vec<(Vec<u8>, &str)> = vec![
        (
            mha("ElementDataFile = scan.raw\n"),
            "detached header is not read",
        ),
        (
            mha("ElementNumberOfChannels = 3\nElementDataFile = LOCAL\n\0"),
            "wanted 1",
        ),
        (
            mha("TransformMatrix = 0.8 0.6 0 -0.6 0.8 0 0 0 1\nElementDataFile = LOCAL\n\0"),
            "oblique",
        ),
        (
            mha("BinaryData = False\nElementDataFile = LOCAL\n1"),
            "wanted True",
        ),
        (
            mha("HeaderSize = -1\nElementDataFile = LOCAL\n\0"),
            "right behind the header",
        ),
        (mha(""), "no ElementDataFile"),
        (
            mha("ElementDataFile = LOCAL\n"),
            "speaks of 1 bytes of samples, there are 0",
        ),
        (b"MZ\x90\n".to_vec(), "UTF-8"),
    ];
    for (file, want) in cases {
        let said = read_metaimage(&file).unwrap_err().to_string();
        assert!(said.contains(want), "{said:?}, wanted {want:?}");
    }
}

/// Sizes whose product wraps, and sizes that are only large, are refused before there is memory for them.
#[test]
fn hostile_sizes_take_no_memory() {
    for sizes in [
        "4294967296 4294967296 1",
        "18446744073709551615 18446744073709551615 18446744073709551615",
        "9223372036854775808 2 1",
        "65536 65536 65536",
        "1024 1024 129",
    ] {
        let file = nrrd(
            &format!(
                "type: short\ndimension: 3\nsizes: {sizes}\nendian: little\nencoding: gzip\nspacings: 1 1 1"
            ),
            &gzip(&[0; 64]),
        );
        assert!(
            matches!(read_nrrd(&file), Err(VolumeError::TooMuch { got, .. }) if MOST_SAMPLE_BYTES < got),
            "{sizes}"
        );
    }
    // As large as may be, and not there: more than the packed bytes can stand for.
    let file = nrrd(
        "type: short\ndimension: 3\nsizes: 1024 1024 128\nendian: little\nencoding: gzip\nspacings: 1 1 1",
        &gzip(&[0; 64]),
    );
    assert!(matches!(
        read_nrrd(&file),
        Err(VolumeError::SelfContradicting { .. })
    ));
    // A bomb that says it is small.
    let file = nrrd(
        "type: uchar\ndimension: 3\nsizes: 10 10 10\nencoding: gzip\nspacings: 1 1 1",
        &gzip(&vec![0; 1 << 22]),
    );
    assert!(matches!(
        read_nrrd(&file),
        Err(VolumeError::SelfContradicting { said: 1000, .. })
    ));
    let mut broken = gzip(&[7; 1000]);
    let checksum = broken.len() - 8;
    broken[checksum] ^= 1;
    let file = nrrd(
        "type: uchar\ndimension: 3\nsizes: 10 10 10\nencoding: gzip\nspacings: 1 1 1",
        &broken,
    );
    let said = read_nrrd(&file).unwrap_err().to_string();
    assert!(said.contains("checksum"), "{said}");
}

#[test]
fn thresholds_must_ascend_and_have_materials() {
    let bone = material(6e5, 0.0);
    assert!(Thresholds::new(vec![0.0, 1.0], vec![bone]).is_ok());
    for (from, further) in [
        (vec![], 0),
        (vec![0.0; 9], 8),
        (vec![0.0, 1.0], 0),
        (vec![0.0], 1),
    ] {
        assert!(matches!(
            Thresholds::new(from, vec![bone; further]),
            Err(VolumeError::Count { .. })
        ));
    }
    for from in [
        vec![1.0, 1.0],
        vec![0.0, f64::NAN],
        vec![0.0, f64::INFINITY],
    ] {
        assert!(matches!(
            Thresholds::new(from, vec![bone]),
            Err(VolumeError::Threshold { index: 1, .. })
        ));
    }
}

/// Spheres, whose volumes are known: one of bone in one of tissue.
#[test]
fn a_volume_becomes_as_much_clay_as_it_has() {
    let sizes = [60, 60, 60];
    let radius = |[x, y, z]: [usize; 3]| {
        let part = |at: usize| (at as f64 - 29.5).powi(2);
        (part(x) + part(y) + part(z)).sqrt()
    };
    // Falls by 100 for each sample away from the middle: 25 samples out it is 500.
    let data = samples(sizes, |at| (3000.0 - 100.0 * radius(at)) as i16);
    let volume = read_nrrd(&short_nrrd(
        sizes,
        "encoding: raw\nspacings: 0.8 0.8 0.8",
        &data,
    ))
    .unwrap();
    let thresholds = Thresholds::new(vec![500.0, 2000.0], vec![material(6e5, 0.0)]).unwrap();
    let cases: [(f64, Placement, f64); 3] = [
        (8e-4, Placement::AsIs, 1.0),
        (5e-4, Placement::AsIs, 1.0),
        (1e-3, Placement::Fitted, 64.0 / 48.0),
    ];
    for (voxel_m, placement, scale) in cases {
        let grid = Grid::of_voxels(
            if placement == Placement::Fitted {
                [64; 3]
            } else {
                [100; 3]
            },
            voxel_m,
        )
        .unwrap();
        let clay = fill_volume(&volume, &grid, &thresholds, placement).unwrap();
        let want_m3 = 4.0 / 3.0 * PI * (25.0 * 0.8e-3 * scale).powi(3);
        let share = clay.remaining_volume_m3() / want_m3;
        assert!((share - 1.0).abs() < 0.01, "{voxel_m}: {share}");
        assert_eq!(clay.initial_units(), clay.remaining_units());
        let classes = clay.classes().unwrap();
        let [nx, ny, nz] = grid.voxels().map(i32::from);
        let mut bone = 0;
        for z in 0..nz {
            for y in 0..ny {
                for x in 0..nx {
                    bone += classes.at([x, y, z]);
                }
            }
        }
        let bone_m3 = bone as f64 * voxel_m.powi(3);
        let want_m3 = 4.0 / 3.0 * PI * (10.0 * 0.8e-3 * scale).powi(3);
        assert!(
            (bone_m3 / want_m3 - 1.0).abs() < 0.02,
            "{voxel_m}: {}",
            bone_m3 / want_m3
        );
    }
    let small = Grid::of_voxels([40; 3], 1e-3).unwrap();
    assert!(matches!(
        fill_volume(&volume, &small, &thresholds, Placement::AsIs),
        Err(VolumeError::TooLarge { .. })
    ));
    let air = Thresholds::new(vec![5000.0], vec![]).unwrap();
    assert!(matches!(
        fill_volume(&volume, &small, &air, Placement::Fitted),
        Err(VolumeError::Empty { .. })
    ));
}

/// Drills down through a scan of tissue over bone, from a file, and compares the steady force in each.
#[test]
fn a_drilled_scan_is_felt_in_the_ratio_that_was_set() {
    let sizes = [40, 40, 48];
    let data = samples(sizes, |[.., z]| if z < 24 { 1200 } else { 60 });
    for (tissue, bone, ratio) in [
        (material(1e5, 0.0), material(6e5, 0.0), 6.0),
        (material(5e4, 5e3), material(2e5, 2e4), 4.0),
    ] {
        let thresholds = Thresholds::new(vec![0.0, 600.0], vec![bone]).unwrap();
        let file = short_nrrd(sizes, "encoding: gzip\nspacings: 1 1 1", &gzip(&data));
        let volume = read_nrrd(&file).unwrap();
        let grid = Grid::of_voxels([80, 80, 96], 5e-4).unwrap();
        let mut clay = fill_volume(&volume, &grid, &thresholds, Placement::AsIs).unwrap();
        let forces = drill(&mut clay, &tissue);
        let mean = |from_m: f64, to_m: f64| {
            let within: Vec<f64> = forces
                .iter()
                .filter(|(height_m, _)| (from_m..to_m).contains(height_m))
                .map(|(_, force_n)| *force_n)
                .collect();
            assert!(100 < within.len());
            within.iter().sum::<f64>() / within.len() as f64
        };
        let got = mean(0.008, 0.019) / mean(0.031, 0.040);
        println!("ratio {got:.4}, set {ratio}");
        assert!((got / ratio - 1.0).abs() < 0.02, "{got}, set {ratio}");
    }
}

/// Height and force, tick by tick.
fn drill(clay: &mut Clay, first: &Material) -> Vec<(f64, f64)> {
    let tool = Tool::new(ToolShape::ball(0.004).unwrap());
    let mut contact = ContactState::default();
    let place = |height_m: f64| Pose::quantise([0.0201, 0.0199, height_m]).unwrap();
    let mut from = place(0.053);
    (1..2300)
        .map(|tick| {
            let height_m = 0.053 - 2e-5 * f64::from(tick);
            let to = place(height_m);
            let motion = Motion::new(from, to, [0.0, 0.0, -0.02]).unwrap();
            from = to;
            let worked = clay.work(&tool, first, &motion, &mut contact);
            (height_m, worked.response.force_n[2])
        })
        .collect()
}

fn seeds() -> Vec<Vec<u8>> {
    let data = samples(SIZES, placed);
    vec![
        short_nrrd(SIZES, "encoding: raw\nspacings: 1 2 3", &data),
        short_nrrd(
            SIZES,
            "encoding: gzip\nspace directions: (1,0,0) (0,2,0) (0,0,3)",
            &gzip(&data),
        ),
        {
            let mut file = b"NDims = 3\nDimSize = 4 5 3\nElementSpacing = 1 2 3\nCompressedData = True\nElementType = MET_SHORT\nElementDataFile = LOCAL\n".to_vec();
            file.extend_from_slice(&miniz_oxide::deflate::compress_to_vec_zlib(&data, 6));
            file
        },
    ]
}

/// A fixed sequence of numbers, by Knuth's linear congruential generator for 64 bits.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % bound
    }
}

/// Whatever the bytes, a reader ends, and what it accepts is whole.
#[test]
fn readers_survive_anything() {
    const INPUTS: usize = 30_000;
    let (seeds, mut random) = (seeds(), Random(0x7e1e_c1a9));
    let mut accepted = 0;
    for _ in 0..INPUTS {
        let mut file = seeds[random.below(seeds.len())].clone();
        for _ in 0..random.below(4) {
            let place = random.below(file.len());
            file[place] = random.below(256) as u8;
        }
        if random.below(4) == 0 {
            let part = file[random.below(file.len())..].to_vec();
            let to = random.below(file.len());
            file.splice(to..to, part);
        }
        if random.below(4) == 0 {
            file.truncate(random.below(file.len()));
        }
        for read in [read_nrrd, read_metaimage] {
            let Ok(volume) = read(&file) else { continue };
            let sizes = volume.sizes();
            let _ = volume.sample(sizes.map(|size| size - 1));
            let _ = volume.sample([0; 3]);
            assert!(volume.spacing_m().iter().all(|m| m.is_finite() && 0.0 < *m));
            accepted += 1;
        }
    }
    println!("{accepted} of {INPUTS} were read");
    assert!(
        INPUTS / 100 < accepted && accepted < INPUTS / 2,
        "{accepted}"
    );
}
