//! Walks over the vertices of a graph, given as the neighbours of each vertex.

/// Brings some `vertices` into the order in which a walk over `neighbours`, breadth first, comes to them
/// from one end of them; pieces that do not hang together follow each other. `inside`, `[vertex]`, is
/// false everywhere, before and after.
pub fn walk_from_end(vertices: &mut [u32], neighbours: &[Vec<u32>], inside: &mut [bool]) {
    // Where a walk from anywhere ends is an end.
    for _ in 0..2 {
        vertices.reverse();
        let walked = walk_over(vertices, neighbours, inside);
        vertices.copy_from_slice(&walked);
    }
}

/// `vertices` in the order in which a walk comes to them from the first.
fn walk_over(vertices: &[u32], neighbours: &[Vec<u32>], inside: &mut [bool]) -> Vec<u32> {
    for v in vertices {
        inside[*v as usize] = true;
    }
    let mut walked = Vec::with_capacity(vertices.len());
    for &start in vertices {
        let mut next = walked.len();
        if std::mem::take(&mut inside[start as usize]) {
            walked.push(start);
        }
        while let Some(&v) = walked.get(next) {
            next += 1;
            for &w in &neighbours[v as usize] {
                if std::mem::take(&mut inside[w as usize]) {
                    walked.push(w);
                }
            }
        }
    }
    walked
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_walked_from_one_end_to_the_other_and_pieces_one_by_one() {
        // 0 – 3 – 1 – 4, and 2 alone; 5 is not asked for.
        let neighbours = [vec![3, 5], vec![4, 3], vec![], vec![1, 0], vec![1], vec![0]];
        let mut inside = vec![false; 6];
        let mut vertices = [3, 1, 4, 0, 2];
        walk_from_end(&mut vertices, &neighbours, &mut inside);
        let path: Vec<u32> = vertices.into_iter().filter(|v| *v != 2).collect();
        assert!(path == [0, 3, 1, 4] || path == [4, 1, 3, 0], "{path:?}");
        assert!([vertices[0], vertices[4]].contains(&2));
        assert_eq!(inside, [false; 6]);
    }
}
