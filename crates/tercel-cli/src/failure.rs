//! Why the program ends without success.

use std::error::Error;
use std::path::Path;
use std::process::ExitCode;

use tercel_data::DataError;
use tercel_neural::ModelError;
use tercel_pipeline::PipelineError;
use tercel_study::StudyError;
use tercel_study::report::ReportError;

/// Why the program ends without success.
#[derive(Debug)]
pub enum Failure {
    /// A file, a table or a configuration cannot be used.
    Input(Report),
    /// The system refused, or the program is at fault.
    Failed(Report),
    /// The arguments do not fit each other.
    Usage(Report),
    /// Nobody reads the output any more, which is no error.
    Unread,
}

/// What is printed about a failure.
#[derive(Debug, Default)]
pub struct Report {
    /// What is wrong and where.
    pub message: String,
    /// What lies behind it, from the nearest cause to the last.
    pub causes: Vec<String>,
    /// What to do about it.
    pub help: Option<String>,
}

impl Report {
    fn new(message: impl Into<String>) -> Self {
        Report { message: message.into(), ..Report::default() }
    }

    /// An error with its causes. A cause that the message before it ends with is not said twice.
    pub fn of(error: &dyn Error) -> Self {
        let message = error.to_string();
        let mut causes: Vec<String> = Vec::new();
        let mut next = error.source();
        while let Some(cause) = next {
            let text = cause.to_string();
            if !causes.last().unwrap_or(&message).ends_with(&text) {
                causes.push(text);
            }
            next = cause.source();
        }
        // Some messages bring their help along.
        match message.split_once("\n  help: ") {
            Some((message, help)) => {
                Report { message: message.to_owned(), causes, help: Some(help.to_owned()) }
            }
            None => Report { message, causes, help: None },
        }
    }
}

impl Failure {
    /// Input that cannot be used.
    pub fn input(message: impl Into<String>) -> Self {
        Failure::Input(Report::new(message))
    }

    /// Something that went wrong.
    pub fn failed(message: impl Into<String>) -> Self {
        Failure::Failed(Report::new(message))
    }

    /// Arguments that do not fit each other.
    pub fn usage(message: impl Into<String>) -> Self {
        Failure::Usage(Report::new(message)).with_help("--help says what fits")
    }

    /// Standard output could not be written.
    pub fn stdout(error: &std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::BrokenPipe => Failure::Unread,
            _ => Failure::failed(format!("standard output: cannot write: {error}")),
        }
    }

    /// A configuration in `file`, whose content is `text`, that cannot be used.
    pub fn config(file: &str, text: &str, error: &PipelineError) -> Self {
        let PipelineError::Syntax(syntax) = error else {
            let report = Report::of(error);
            return Failure::Input(Report { message: format!("{file}: {}", report.message), ..report });
        };
        // The parser repeats the line with a marker in its own message; here it stands below place and reason.
        let message = syntax.message();
        let message = match syntax.span().and_then(|span| text.get(..span.start)) {
            Some(before) => {
                let number = before.matches('\n').count() + 1;
                let line = text.lines().nth(number - 1).unwrap_or_default();
                format!("{file}:{number}: {message}\n  | {}", line.trim_end())
            }
            None => format!("{file}: {message}"),
        };
        Failure::Input(Report::new(message)).with_help("`tercel config schema` describes every key")
    }

    /// The same with what to do about it.
    pub fn with_help(mut self, text: impl Into<String>) -> Self {
        if let Some(report) = self.report_mut() {
            report.help = Some(text.into());
        }
        self
    }

    /// The same with the name of the file in which it was found.
    pub fn found_in(mut self, file: &str) -> Self {
        if let Some(report) = self.report_mut() {
            report.message.insert_str(0, &format!("{file}: "));
        }
        self
    }

    /// What is printed, if anything is.
    pub fn report(&self) -> Option<&Report> {
        match self {
            Failure::Input(report) | Failure::Failed(report) | Failure::Usage(report) => Some(report),
            Failure::Unread => None,
        }
    }

    fn report_mut(&mut self) -> Option<&mut Report> {
        match self {
            Failure::Input(report) | Failure::Failed(report) | Failure::Usage(report) => Some(report),
            Failure::Unread => None,
        }
    }

    /// The code that the program ends with.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(match self {
            Failure::Unread => 0,
            Failure::Failed(_) => 1,
            Failure::Usage(_) => 2,
            Failure::Input(_) => 3,
        })
    }
}

impl From<DataError> for Failure {
    fn from(error: DataError) -> Self {
        let help = error.help().map(str::to_owned);
        let report = Report { help, ..Report::of(&error) };
        match &error {
            DataError::Io { source, .. } if source.kind() == std::io::ErrorKind::BrokenPipe => {
                Failure::Unread
            }
            // A file that cannot be opened is one that the user named wrongly.
            DataError::Io { action: "open", .. } => Failure::Input(report),
            DataError::Io { .. } => Failure::Failed(report),
            _ => Failure::Input(report),
        }
    }
}

impl From<ModelError> for Failure {
    fn from(error: ModelError) -> Self {
        let report = Report::of(&error);
        match error {
            ModelError::Io { action: "write", .. } => Failure::Failed(report),
            _ => Failure::Input(report),
        }
    }
}

impl From<PipelineError> for Failure {
    fn from(error: PipelineError) -> Self {
        Failure::Input(Report::of(&error))
    }
}

impl From<StudyError> for Failure {
    fn from(error: StudyError) -> Self {
        match error {
            StudyError::Data(error) => error.into(),
            StudyError::Report(error) => error.into(),
            StudyError::Score(_) | StudyError::Threads(_) | StudyError::Output { .. } => {
                Failure::Failed(Report::of(&error))
            }
            StudyError::Unknown { .. } | StudyError::UnknownMethod { .. } | StudyError::Option(_) => {
                Failure::Usage(Report::of(&error))
            }
            _ => Failure::Input(Report::of(&error)),
        }
    }
}

impl From<ReportError> for Failure {
    fn from(error: ReportError) -> Self {
        Failure::Failed(Report::of(&error))
    }
}

/// Reads a text file, `-` for standard input.
pub fn read_text(path: &Path) -> Result<String, Failure> {
    let text = match path.to_str() {
        Some("-") => std::io::read_to_string(std::io::stdin()),
        _ => std::fs::read_to_string(path),
    };
    text.map_err(|error| Failure::input(format!("{}: cannot read: {error}", path.display())))
}
