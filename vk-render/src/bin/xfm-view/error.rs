//! What can go wrong, and the one line that says so.

use std::path::PathBuf;

/// Why something could not be done; in a window it is said there, otherwise the viewer stops.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    #[error(transparent)]
    Mesh(#[from] mesh_io::Error),
    #[error("{path}: there is no triangle to show", path = .0.display())]
    Empty(PathBuf),
    #[error("{path}: this is a folder; give one of the files in it", path = .0.display())]
    Folder(PathBuf),
    #[error("{path}: opening broke off; this is a fault of the viewer, xfm verify may tell more", path = .0.display())]
    Broken(PathBuf),
    #[error("{path}: {source}", path = path.display())]
    Build { path: PathBuf, source: xfm_build::MeshError },
    #[error(transparent)]
    Pager(#[from] xfm_pager::Error),
    #[error(transparent)]
    Render(#[from] vk_render::Error),
    #[error("{path}: {source}", path = path.display())]
    Path { path: PathBuf, source: mergetree::CameraPathError },
    #[error(
        "this is no view: {0}; a view is nine numbers: eye, point looked at and up, as 0,0,5 0,0,0 0,1,0"
    )]
    View(String),
    #[error(
        "{path}: {source}; check the path, its permissions and the free space",
        path = path.display()
    )]
    File { path: PathBuf, source: std::io::Error },
    #[error("{path}: {source}", path = path.display())]
    Png { path: PathBuf, source: png::EncodingError },
    #[error(
        "no window can be opened: {0}; use --offscreen, or start it where there is a display (over ssh: ssh -X)"
    )]
    Window(String),
    #[error("no file to draw; give a .xfm file or a mesh")]
    NoFile,
    #[error("the validation layer complains: {0}")]
    Validation(String),
}

impl Error {
    /// What a window system said, without the place in the sources where it was said.
    pub(crate) fn window(error: impl std::fmt::Display) -> Self {
        let text = error.to_string();
        let reason = text.rsplit_once(".rs:").map_or(text.as_str(), |(_, rest)| {
            rest.trim_start_matches(|c: char| c.is_ascii_digit()).trim_start_matches(": ")
        });
        Self::Window(reason.to_owned())
    }

    pub(crate) fn file(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        |source| Self::File { path, source }
    }
}

/// An error with its causes, each said once.
pub(crate) fn one_line(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(source) = cause {
        let more = source.to_string();
        if !text.contains(&more) {
            text = format!("{text}: {more}");
        }
        cause = source.source();
    }
    text.replace('\n', " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn window_errors_are_told_without_their_source_file() {
        for said in ["os error at /home/me/src/linux/mod.rs:788: no display", "no display"] {
            let text = Error::window(said).to_string();
            assert!(text.starts_with("no window can be opened: no display; use --off"), "{text}");
        }
    }
}
