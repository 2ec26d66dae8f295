use super::*;
use crate::check::noise;
use flate2::Compression;
use flate2::write::DeflateEncoder;
use std::io::Write;

/// A member's header as NumPy writes it, padded to 64 bytes.
pub(crate) fn npy(descr: &str, fortran: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let mut text = format!("{{'descr': {descr}, 'fortran_order': {fortran}, 'shape': {shape}, }}");
    while (10 + text.len() + 1) % 64 != 0 {
        text.push(' ');
    }
    text.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes.extend(data);
    bytes
}

/// A zip of these members; `size` overrides what the directory says of the inflated size.
pub(crate) fn zip(members: &[(&str, Vec<u8>)], deflate: bool, size: Option<u32>) -> Vec<u8> {
    let (mut bytes, mut list) = (Vec::new(), Vec::new());
    for (name, content) in members {
        let packed = if deflate {
            let mut encoder = DeflateEncoder::new(Vec::new(), Compression::fast());
            encoder.write_all(content).unwrap();
            encoder.finish().unwrap()
        } else {
            content.clone()
        };
        let name = format!("{name}.npy");
        let mut shared = vec![20, 0, 0, 0, if deflate { 8 } else { 0 }, 0];
        shared.extend([0; 8]);
        shared.extend((packed.len() as u32).to_le_bytes());
        shared.extend(size.unwrap_or(content.len() as u32).to_le_bytes());
        shared.extend((name.len() as u16).to_le_bytes());
        shared.extend([0; 2]);
        let offset = bytes.len() as u32;
        bytes.extend(b"PK\x03\x04");
        bytes.extend(&shared);
        bytes.extend(name.as_bytes());
        bytes.extend(&packed);
        list.extend(b"PK\x01\x02\x14\x00");
        list.extend(&shared);
        list.extend([0; 10]);
        list.extend(offset.to_le_bytes());
        list.extend(name.as_bytes());
    }
    let (start, length) = (bytes.len() as u32, list.len() as u32);
    bytes.extend(&list);
    bytes.extend(b"PK\x05\x06\0\0\0\0");
    bytes.extend([(members.len() as u16).to_le_bytes(); 2].concat());
    bytes.extend(length.to_le_bytes());
    bytes.extend(start.to_le_bytes());
    bytes.extend([0, 0]);
    bytes
}

fn complaint(member: Vec<u8>, size: Option<u32>) -> String {
    let bytes = zip(&[("a", member)], true, size);
    let archive = Archive::parse(&bytes).unwrap();
    archive.numbers("a").unwrap_err().to_string()
}

#[test]
fn numbers_of_every_type_and_order_are_read() {
    let le: Vec<u8> = [1.5_f32, -2.0, 0.25, 4.0, 5.0, 6.0]
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    let be: Vec<u8> = [-3_i16, 300].iter().flat_map(|v| v.to_be_bytes()).collect();
    for deflate in [false, true] {
        let members = [
            ("rows", npy("'<f4'", "False", "(2, 3)", &le)),
            ("columns", npy("'<f4'", "True", "(3, 2)", &le)),
            ("big", npy("'>i2'", "False", "(2,)", &be)),
            ("one", npy("'|u1'", "False", "()", &[200])),
        ];
        let bytes = zip(&members, deflate, None);
        let archive = Archive::parse(&bytes).unwrap();
        let rows = archive.numbers("rows").unwrap();
        assert_eq!(
            (rows.shape, rows.values),
            (vec![2, 3], vec![1.5, -2.0, 0.25, 4.0, 5.0, 6.0])
        );
        // The first axis was fastest: (0,0) (1,0) (2,0) (0,1) …
        let columns = archive.numbers("columns").unwrap().values;
        assert_eq!(columns, [1.5, 4.0, -2.0, 5.0, 0.25, 6.0]);
        assert_eq!(archive.numbers("big").unwrap().values, [-3.0, 300.0]);
        assert_eq!(archive.numbers("one").unwrap().values, [200.0]);
        assert!(archive.has("one") && !archive.has("two"));
    }
}

#[test]
fn a_header_may_claim_anything_and_nothing_is_allocated_for_it() {
    // 2^62 rows of eight would wrap to nothing in 64 bits.
    for shape in [
        "(4611686018427387904, 8)",
        "(0, 4611686018427387904, 8)",
        "(1000000, 1000)",
    ] {
        let told = complaint(npy("'<f8'", "False", shape, &[0; 8]), None);
        assert!(told.contains("more than the 256 MiB"), "{told}");
    }
    let told = complaint(npy("'<f8'", "False", "(100,)", &[0; 8]), None);
    assert!(told.contains("the archive says that it holds"), "{told}");
    // The directory agrees with the header, and the member still ends early.
    let member = npy("'<f8'", "False", "(100,)", &[0; 8]);
    let claimed = (member.len() - 8 + 800) as u32;
    let told = complaint(member, Some(claimed));
    assert!(told.contains("cannot be inflated"), "{told}");
}

#[test]
fn a_member_that_inflates_a_thousandfold_is_refused_by_its_header() {
    // 300 MB of zeros deflate to 1.3 MB with room to spare; only the header is ever inflated.
    let count = 300_000_000 / 8;
    let member = npy(
        "'<f8'",
        "False",
        &format!("({count},)"),
        &vec![0; 8 * count],
    );
    let bytes = zip(&[("a", member)], true, None);
    assert!(bytes.len() < 3_000_000, "{}", bytes.len());
    let told = Archive::parse(&bytes).unwrap().numbers("a").unwrap_err();
    assert!(told.to_string().contains("more than the 256 MiB"), "{told}");
}

#[test]
fn objects_tables_and_what_is_not_a_number_are_refused_with_advice() {
    let told = complaint(npy("'|O'", "False", "(3,)", b"\x80\x02cos\nsystem\n"), None);
    assert!(told.contains("tools/convert_smpl.py"), "{told}");
    let told = complaint(npy("[('a', '<f4')]", "False", "(3,)", &[0; 12]), None);
    assert!(told.contains("table"), "{told}");
    let told = complaint(npy("'<f8'", "False", "(1,)", &f64::NAN.to_le_bytes()), None);
    assert!(told.contains("entry 0 is not a finite number"), "{told}");
    let told = complaint(npy("'<c16'", "False", "(1,)", &[0; 16]), None);
    assert!(told.contains("`<c16`"), "{told}");
}

#[test]
fn damaged_archives_never_panic() {
    let good = zip(
        &[("a", npy("'<f4'", "False", "(2, 3)", &[1; 24]))],
        true,
        None,
    );
    for i in 0..20_000 {
        let mut bytes = good.clone();
        for k in 0..=(i % 3) {
            let random = |j: usize| 0.5 + 0.5 * noise(10 * i + j);
            let at = (random(2 * k) * bytes.len() as f64) as usize;
            bytes[at] = (random(2 * k + 1) * 256.0) as u8;
        }
        bytes.truncate(bytes.len() - if i % 7 == 0 { i % bytes.len() } else { 0 });
        if let Ok(archive) = Archive::parse(&bytes) {
            let _ = (archive.numbers("a"), archive.texts("a"));
        }
    }
}
