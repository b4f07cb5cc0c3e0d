//! Result files: written under temporary names, renamed together at the end, gone after an error.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::failure::Failure;
use crate::interrupt;

/// Files on their way into one folder.
///
/// Nothing appears under its own name before [`OutputSet::commit`]; dropping the set before removes its
/// temporary files and the folders it made.
#[derive(Debug)]
pub struct OutputSet {
    folder: PathBuf,
    /// Folders made for this set, outermost first.
    made: Vec<PathBuf>,
    files: Vec<(NamedTempFile, PathBuf)>,
    /// Older results that the new ones make void.
    void: Vec<PathBuf>,
}

impl OutputSet {
    /// Opens the folder, making it if needed.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub fn open(folder: &Path) -> Result<Self, Failure> {
        let missing = folder.ancestors().take_while(|f| !f.as_os_str().is_empty() && !f.exists());
        let mut made: Vec<PathBuf> = missing.map(Path::to_path_buf).collect();
        made.reverse();
        let set = OutputSet { folder: folder.to_path_buf(), made, files: Vec::new(), void: Vec::new() };
        let mut pending = interrupt::pending();
        pending.folders.extend_from_slice(&set.made);
        fs::create_dir_all(folder).map_err(|e| Failure::unwritable(folder, &e))?;
        Ok(set)
    }

    /// Writes one file of the set.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&mut self, name: &str, contents: &[u8]) -> Result<PathBuf, Failure> {
        let mut stream = self.stream(name)?;
        let path = self.folder.join(name);
        stream
            .write_all(contents)
            .and_then(|()| stream.flush())
            .map_err(|e| Failure::unwritable(&path, &e))?;
        Ok(path)
    }

    /// Opens one file of the set for writing piece by piece; the writer has to be flushed.
    ///
    /// # Errors
    /// It cannot be created.
    pub fn stream(&mut self, name: &str) -> Result<BufWriter<File>, Failure> {
        let path = self.folder.join(name);
        let mut pending = interrupt::pending();
        let open = || -> io::Result<(NamedTempFile, File)> {
            if path.is_dir() {
                return Err(io::Error::from(io::ErrorKind::IsADirectory));
            }
            let file =
                tempfile::Builder::new().prefix(".feedspline-").suffix(".part").tempfile_in(&self.folder)?;
            let handle = file.as_file().try_clone()?;
            Ok((file, handle))
        };
        let (file, handle) = open().map_err(|e| Failure::unwritable(&path, &e))?;
        pending.files.push(file.path().to_path_buf());
        self.files.push((file, path));
        Ok(BufWriter::new(handle))
    }

    /// Lets [`OutputSet::commit`] remove an older result that must not stand beside the new ones.
    pub fn retire(&mut self, name: &str) {
        self.void.push(self.folder.join(name));
    }

    /// Gives every file its own name, then removes the retired ones.
    ///
    /// # Errors
    /// A file cannot be renamed or removed. Those renamed before stay, for they may have taken the place of
    /// older ones; the failure names them.
    pub fn commit(mut self) -> Result<(), Failure> {
        // Held to the end: an interrupt comes before the first new name or after the last.
        let mut pending = interrupt::pending();
        let mut done: Vec<String> = Vec::new();
        let incomplete = |path: &Path, error: &io::Error, done: &[String]| {
            let failure = Failure::unwritable(path, error);
            if done.is_empty() {
                return failure;
            }
            failure.with_help(format!(
                "The results are not complete; already new are {}. Choose another folder with --out.",
                done.join(", ")
            ))
        };
        let mut files = std::mem::take(&mut self.files).into_iter();
        while let Some((file, path)) = files.next() {
            let temporary = file.path().to_path_buf();
            let renamed = share(&file).and_then(|()| file.persist(&path).map_err(|e| e.error));
            pending.files.retain(|f| *f != temporary);
            if let Err(error) = renamed {
                // The others go the way of a set that is dropped.
                self.files = files.collect();
                drop(pending);
                return Err(incomplete(&path, &error, &done));
            }
            done.push(path.display().to_string());
        }
        pending.folders.retain(|f| !self.made.contains(f));
        self.made.clear();
        for path in std::mem::take(&mut self.void) {
            match fs::remove_file(&path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    drop(pending);
                    return Err(incomplete(&path, &error, &done));
                }
                _ => {}
            }
        }
        drop(pending);
        Ok(())
    }
}

/// Gives a temporary file, private by default, the permissions of an ordinary one.
#[cfg(unix)]
fn share(file: &NamedTempFile) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    fs::set_permissions(file.path(), fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn share(_: &NamedTempFile) -> io::Result<()> {
    Ok(())
}

impl Drop for OutputSet {
    fn drop(&mut self) {
        let mut pending = interrupt::pending();
        pending.files.retain(|f| self.files.iter().all(|(file, _)| file.path() != f));
        pending.folders.retain(|f| !self.made.contains(f));
        self.files.clear();
        for folder in self.made.iter().rev() {
            // Fails when somebody else put something in; then it stays.
            let _ = fs::remove_dir(folder);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn files_appear_together_at_commit() {
        let home = tempfile::tempdir().unwrap();
        let folder = home.path().join("a/b");
        let mut set = OutputSet::open(&folder).unwrap();
        set.write("one", b"1").unwrap();
        let mut two = set.stream("two").unwrap();
        two.write_all(b"22").unwrap();
        two.flush().unwrap();
        assert!(names(&folder).iter().all(|n| n.ends_with(".part")));
        set.commit().unwrap();
        assert_eq!(names(&folder), ["one", "two"]);
        assert_eq!(fs::read(folder.join("two")).unwrap(), b"22");
    }

    #[test]
    fn nothing_stays_behind_without_commit() {
        let home = tempfile::tempdir().unwrap();
        let mut set = OutputSet::open(&home.path().join("a/b")).unwrap();
        set.write("one", b"1").unwrap();
        drop(set);
        assert!(names(home.path()).is_empty());
    }

    #[test]
    fn older_results_survive_a_failed_set() {
        let home = tempfile::tempdir().unwrap();
        fs::write(home.path().join("one"), b"old").unwrap();
        let mut set = OutputSet::open(home.path()).unwrap();
        set.write("one", b"new").unwrap();
        drop(set);
        assert_eq!(fs::read(home.path().join("one")).unwrap(), b"old");
        assert_eq!(names(home.path()), ["one"]);
    }

    #[test]
    fn a_failed_rename_takes_nothing_away() {
        let home = tempfile::tempdir().unwrap();
        fs::write(home.path().join("one"), b"old").unwrap();
        let mut set = OutputSet::open(home.path()).unwrap();
        for name in ["one", "two", "three"] {
            set.write(name, b"new").unwrap();
        }
        set.retire("void");
        fs::write(home.path().join("void"), b"old").unwrap();
        fs::create_dir(home.path().join("two")).unwrap();
        let failure = set.commit().unwrap_err();
        assert_eq!(failure.file, Some(home.path().join("two")));
        assert!(failure.help.unwrap().contains("one"));
        assert_eq!(fs::read(home.path().join("one")).unwrap(), b"new");
        assert_eq!(names(home.path()), ["one", "two", "void"]);
    }

    #[test]
    fn retired_files_go_at_commit() {
        let home = tempfile::tempdir().unwrap();
        fs::write(home.path().join("old"), b"old").unwrap();
        let mut set = OutputSet::open(home.path()).unwrap();
        set.retire("old");
        set.retire("never there");
        set.write("new", b"new").unwrap();
        assert!(names(home.path()).contains(&"old".to_string()));
        set.commit().unwrap();
        assert_eq!(names(home.path()), ["new"]);
    }

    #[test]
    fn a_file_in_place_of_the_folder_is_bad_input() {
        let home = tempfile::tempdir().unwrap();
        let file = home.path().join("file");
        fs::write(&file, b"").unwrap();
        assert_eq!(OutputSet::open(&file.join("sub")).unwrap_err().exit_status(), 2);
        assert_eq!(names(home.path()), ["file"]);
    }
}
