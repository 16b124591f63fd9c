#include "core/io/recorder.hpp"

#include <fmt/format.h>

namespace cardan {

const std::vector<NoteKind>& note_kinds() {
  static const std::vector<NoteKind> kinds = {{Note::phase, "phases", {"name"}},
                                              {Note::event, "events", {"name", "direction"}},
                                              {Note::printed, "printed", {"line", "by"}},
                                              {Note::warning, "warnings", {"code", "about", "path", "place", "hint"}}};
  return kinds;
}

void note(Recorder& recorder, const Warning& w) {
  const Diagnostic& d = w.what;
  const SourceMark& at = d.at.mark;
  recorder.note(Note::warning, w.t,
                {std::string(number_of(d.code)), d.about.empty() ? std::string(title_of(d.code)) : d.about, d.at.key_path,
                 at.line > 0 ? fmt::format("{}:{}", at.file, at.line) : at.file, d.hint});
}

void note(Recorder& recorder, const StepInterval& interval) {
  std::vector<double> numbers;
  for (const StepInterval::Column& c : interval.columns()) numbers.push_back(c.value);
  recorder.steps(numbers, interval.worst);
}

}  // namespace cardan
