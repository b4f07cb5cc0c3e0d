//! Result files: written under temporary names, renamed together at the end, gone after an error.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::failure::Failure;

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
        let set = OutputSet { folder: folder.to_path_buf(), made, files: Vec::new() };
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
        self.files.push((file, path));
        Ok(BufWriter::new(handle))
    }

    /// Gives every file its own name.
    ///
    /// # Errors
    /// A file cannot be renamed; those already renamed are removed again.
    pub fn commit(mut self) -> Result<(), Failure> {
        let mut done: Vec<PathBuf> = Vec::new();
        for (file, path) in std::mem::take(&mut self.files) {
            if let Err(error) = share(&file).and_then(|()| file.persist(&path).map_err(|e| e.error)) {
                for path in &done {
                    // The first error is the one to tell.
                    let _ = fs::remove_file(path);
                }
                return Err(Failure::unwritable(&path, &error));
            }
            done.push(path);
        }
        self.made.clear();
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
    fn a_file_in_place_of_the_folder_is_bad_input() {
        let home = tempfile::tempdir().unwrap();
        let file = home.path().join("file");
        fs::write(&file, b"").unwrap();
        assert_eq!(OutputSet::open(&file.join("sub")).unwrap_err().exit_status(), 2);
        assert_eq!(names(home.path()), ["file"]);
    }
}
