#pragma once
// What a user sees when the input is wrong or the numbers fail. One type, one renderer, whatever the source: YAML,
// Lua, a plugin or the command line.
#include <exception>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/source_mark.hpp"

namespace cardan {

/// A value of the input: the path of its key or object ("bodies.panel_1.hinge.type") and where it stands.
struct Located {
  std::string key_path{};
  SourceMark mark{};
};

/// One entry of error_codes.inc.
enum class Code {
#define CARDAN_ERROR(number, name, title) name,
#include "core/base/error_codes.inc"
#undef CARDAN_ERROR
};

std::string_view number_of(Code);  ///< "C0204"
std::string_view title_of(Code);   ///< "unknown hinge type"
/// The code with this number; empty if there is none.
std::optional<Code> find_code(std::string_view number);

/// One answer: where, which key, what was expected, what was got, what now. What does not apply is left out, from the end or by name:
/// Diagnostic{Code::wrong_type, at, "a number", "a text"}, {.code = Code::cannot_write, .at = at, .got = why}.
struct Diagnostic {
  Code code{};
  Located at{};
  std::string expected{}, got{}, hint{};
  std::string stack{};  ///< Lua traceback or the like, one line per frame
  std::string about{};  ///< overrides the title when the code alone says too little
  int span = 0;         ///< characters to underline at mark.column; 0 = to the end of the word
};

/// The text of one diagnostic, with the line of the source file where that can be read. Format: docs/errors.md.
std::string render(const Diagnostic&);
/// All of them, then the closing line "N errors. Nothing was run."
std::string render(const std::vector<Diagnostic>&);
/// Words at an edit distance of at most 2 from `word`, nearest first, as `did you mean "x"?`; empty if none.
std::string did_you_mean(std::string_view word, const std::vector<std::string>& legal);

/// The user's input is wrong (exit code 2). Carries everything that was found, not only the first.
class InputError : public std::exception {
 public:
  explicit InputError(Diagnostic one);
  explicit InputError(std::vector<Diagnostic> all);
  const char* what() const noexcept override { return text_.c_str(); }
  const std::vector<Diagnostic>& diagnostics() const { return all_; }

 private:
  std::vector<Diagnostic> all_;
  std::string text_;
};
/// Throws the InputError of this one answer.
[[noreturn]] void refuse(Code code, Located at, std::string expected = {}, std::string got = {}, std::string hint = {});

/// The numbers failed during a run (exit code 3): what, where, when.
struct RunFailure {
  Code code{};
  double t = 0.0;  // [s]; NaN: of no instant
  std::string body{}, hinge{};
  std::string what{};  ///< the quantity with its value and limit: "D = 3.1e-19 kg m^2, limit 1e-12, direction wing.angle"
  std::string hint{};
  std::string last_good{};  ///< where the last accepted state was written
};
std::string render(const RunFailure&);

class NumericsError : public std::exception {
 public:
  explicit NumericsError(RunFailure failure);
  const char* what() const noexcept override { return text_.c_str(); }
  const RunFailure& failure() const { return failure_; }

 private:
  RunFailure failure_;
  std::string text_;
};

/// Collects diagnostics while a file is read; `throw_if_any()` ends the reading. At most kLimit are kept, and of those
/// that concern one value (the same key path, or an object of which a part is wrong already) only the first.
class DiagnosticSink {
 public:
  static constexpr std::size_t kLimit = 20;
  void report(Diagnostic d);
  void report(Code code, Located at, std::string expected, std::string got, std::string hint = {});
  bool empty() const { return all_.empty(); }
  bool full() const { return all_.size() >= kLimit; }  ///< further checks are of no use
  const std::vector<Diagnostic>& all() const { return all_; }
  void throw_if_any() const;

 private:
  std::vector<Diagnostic> all_;
};

}  // namespace cardan
