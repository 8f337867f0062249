//! Edits of a mesh's objects by hand: rename, join, cut.

use crate::capture::mesh::Mesh;
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// One edit. Names are those after all earlier edits.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Regroup {
    /// Gives an object another name.
    Rename {
        /// The object.
        object: String,
        /// Its new name, which no other object has.
        name: String,
    },
    /// Joins objects into the first of them.
    Join {
        /// Two objects or more.
        objects: Vec<String>,
    },
    /// Makes faces an object of their own, whichever objects they belong to.
    Cut {
        /// The faces as runs of consecutive indices: first face and number of faces.
        faces: Vec<[u32; 2]>,
        /// The new object's name, which no other object has.
        name: String,
    },
}

impl Regroup {
    /// A cut of faces in ascending order.
    pub fn cut(faces: impl IntoIterator<Item = u32>, name: String) -> Self {
        let mut runs: Vec<[u32; 2]> = Vec::new();
        for face in faces {
            match runs.last_mut() {
                Some([first, count]) if *first + *count == face => *count += 1,
                _ => runs.push([face, 1]),
            }
        }
        Self::Cut { faces: runs, name }
    }
}

/// Applies edits to a mesh's objects in order. Objects without faces are removed.
///
/// # Errors
/// An edit names an unknown object or face, a name that is taken, or nothing.
pub fn regroup(mesh: &mut Mesh, changes: &[Regroup]) -> Result<()> {
    for change in changes {
        match change {
            Regroup::Rename { object, name } => {
                let object = index_of(mesh, object)?;
                if mesh.objects[object] != *name {
                    mesh.objects[object] = unused(mesh, name)?;
                }
            }
            Regroup::Join { objects } => {
                let joined: Vec<u32> = (objects.iter())
                    .map(|object| Ok(index_of(mesh, object)? as u32))
                    .collect::<Result<_>>()?;
                let Some(&first) = joined.first() else {
                    return Err(wrong("names no object to join"));
                };
                for object in &mut mesh.object_of {
                    if joined.contains(object) {
                        *object = first;
                    }
                }
            }
            Regroup::Cut { faces, name } => {
                let name = unused(mesh, name)?;
                let new = mesh.objects.len() as u32;
                for &[first, count] in faces {
                    let run = first as usize..first as usize + count as usize;
                    let Some(run) = mesh.object_of.get_mut(run) else {
                        return Err(wrong(&format!(
                            "cuts out {count} faces from face {first} on, and the mesh has {}",
                            mesh.triangles.len()
                        )));
                    };
                    run.fill(new);
                }
                mesh.objects.push(name);
            }
        }
        drop_empty(mesh);
    }
    Ok(())
}

/// For each object of the grouping `before`, the object of the grouping `after` with exactly the same faces, if there is one.
/// Both hold the object of each face; `objects` is the number of objects before.
pub fn same_objects(before: &[u32], after: &[u32], objects: usize) -> Vec<Option<u32>> {
    let mut same: Vec<Option<u32>> = vec![None; objects];
    let mut faces = vec![0usize; objects];
    let mut mixed = vec![false; objects];
    for (&from, &to) in before.iter().zip(after) {
        let from = from as usize;
        faces[from] += 1;
        mixed[from] |= *same[from].get_or_insert(to) != to;
    }
    let others = after.iter().max().map_or(0, |&max| max as usize + 1);
    let mut faces_after = vec![0usize; others];
    for &to in after {
        faces_after[to as usize] += 1;
    }
    (0..objects)
        .map(|k| same[k].filter(|&to| !mixed[k] && faces_after[to as usize] == faces[k]))
        .collect()
}

fn index_of(mesh: &Mesh, object: &str) -> Result<usize> {
    let index = mesh.objects.iter().position(|name| name == object);
    index.ok_or_else(|| {
        wrong(&format!(
            "names the object {object:?}, which does not exist"
        ))
    })
}

/// `name`, checked to be new and not empty.
fn unused(mesh: &Mesh, name: &str) -> Result<String> {
    match name {
        "" => Err(wrong("gives an object no name")),
        _ if mesh.objects.iter().any(|other| other == name) => Err(wrong(&format!(
            "gives a second object the name {name:?}; names must be unique"
        ))),
        _ => Ok(name.to_owned()),
    }
}

fn wrong(what: &str) -> Error {
    Error::new(
        "objects",
        format!("a change {what}"),
        "undo the change, or edit the objects of this mesh again",
    )
}

fn drop_empty(mesh: &mut Mesh) {
    let mut used = vec![false; mesh.objects.len()];
    for &object in &mesh.object_of {
        used[object as usize] = true;
    }
    if used.iter().all(|&used| used) {
        return;
    }
    let mut new_index = vec![0; used.len()];
    let mut objects = Vec::new();
    for (k, name) in std::mem::take(&mut mesh.objects).into_iter().enumerate() {
        if used[k] {
            new_index[k] = objects.len() as u32;
            objects.push(name);
        }
    }
    mesh.objects = objects;
    for object in &mut mesh.object_of {
        *object = new_index[*object as usize];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Six faces, two an object.
    fn mesh() -> Mesh {
        Mesh {
            triangles: vec![[0, 1, 2]; 6],
            object_of: vec![0, 0, 1, 1, 2, 2],
            objects: ["floor", "wall", "lamp"].map(String::from).to_vec(),
            ..Mesh::default()
        }
    }

    fn join(objects: &[&str]) -> Regroup {
        Regroup::Join {
            objects: objects.iter().map(ToString::to_string).collect(),
        }
    }

    fn rename(object: &str, name: &str) -> Regroup {
        Regroup::Rename {
            object: object.into(),
            name: name.into(),
        }
    }

    #[test]
    fn objects_are_named_joined_and_cut_in_turn() {
        let mut mesh = mesh();
        let changes = [
            rename("wall", "door"),
            join(&["door", "floor"]),
            Regroup::cut([1, 2, 4, 5], "rug".into()),
        ];
        regroup(&mut mesh, &changes).expect("all is there");
        // The lamp has lost all its faces.
        assert_eq!(mesh.objects, ["door", "rug"]);
        assert_eq!(mesh.object_of, [0, 1, 1, 0, 1, 1]);
        let Regroup::Cut { faces, .. } = &changes[2] else {
            unreachable!()
        };
        assert_eq!(faces, &[[1, 2], [4, 2]]);
    }

    #[test]
    fn changes_of_what_is_not_there_are_errors() {
        for change in [
            rename("chair", "table"),
            rename("wall", "floor"),
            rename("wall", ""),
            join(&["wall", "chair"]),
            join(&[]),
            Regroup::cut([5, 6], "rug".into()),
            Regroup::cut([u32::MAX], "rug".into()),
            Regroup::cut([1], "floor".into()),
        ] {
            let changes = [change];
            assert!(regroup(&mut mesh(), &changes).is_err(), "{changes:?}");
        }
        regroup(&mut mesh(), &[rename("wall", "wall")]).expect("it has that name");
    }

    #[test]
    fn objects_with_the_same_faces_are_the_same_whatever_their_place() {
        let before = mesh();
        let mut after = mesh();
        let changes = [join(&["floor", "lamp"]), rename("wall", "door")];
        regroup(&mut after, &changes).expect("all is there");
        let same = same_objects(&before.object_of, &after.object_of, 3);
        assert_eq!(same, [None, Some(1), None]);
        let back = same_objects(&after.object_of, &before.object_of, 2);
        assert_eq!(back, [None, Some(1)]);
    }
}
