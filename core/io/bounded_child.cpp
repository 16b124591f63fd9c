#include "core/io/bounded_child.hpp"

#include <fmt/format.h>
#include <signal.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <new>

#include "core/base/diagnostic.hpp"

namespace cardan {
namespace {

enum class Answer : std::size_t { bytes, input_error, numerics_error, other };

[[noreturn]] void refuse(const std::string& file, std::string got, std::string hint = "the file is damaged") {
  refuse(Code::bad_result_file, {"", {file}}, "a file that can be read", std::move(got), std::move(hint));
}

void write(ByteWriter& out, const Diagnostic& d) {
  out.number(static_cast<std::size_t>(d.code));
  for (const std::string* text : {&d.at.key_path, &d.at.mark.file, &d.expected, &d.got, &d.hint, &d.stack, &d.about}) out.text(*text);
  for (int number : {d.at.mark.line, d.at.mark.column, d.span}) out.number(static_cast<std::size_t>(number));
}
Diagnostic read_diagnostic(ByteReader& in) {
  Diagnostic d{};
  d.code = static_cast<Code>(in.number());
  for (std::string* text : {&d.at.key_path, &d.at.mark.file, &d.expected, &d.got, &d.hint, &d.stack, &d.about}) *text = in.text();
  for (int* number : {&d.at.mark.line, &d.at.mark.column, &d.span}) *number = static_cast<int>(in.number());
  return d;
}

void write(ByteWriter& out, const RunFailure& f) {
  out.number(static_cast<std::size_t>(f.code));
  out.raw(&f.t, sizeof f.t);
  for (const std::string* text : {&f.body, &f.hinge, &f.what, &f.hint, &f.last_good}) out.text(*text);
}
RunFailure read_failure(ByteReader& in) {
  RunFailure f{};
  f.code = static_cast<Code>(in.number());
  in.raw(&f.t, sizeof f.t);
  for (std::string* text : {&f.body, &f.hinge, &f.what, &f.hint, &f.last_good}) *text = in.text();
  return f;
}

/// What the child sends: the kind of its answer, then the answer.
std::string answer_of(const std::function<std::string()>& work, const ChildLimits& limits) {
  ByteWriter out;
  const auto begin = [&](Answer kind) {
    out = {};  // what was written before memory ran out is no answer
    out.number(static_cast<std::size_t>(kind));
  };
  try {
    const std::string bytes = work();
    begin(Answer::bytes);
    out.raw(bytes.data(), bytes.size());
  } catch (const InputError& e) {
    begin(Answer::input_error);
    out.number(e.diagnostics().size());
    for (const Diagnostic& d : e.diagnostics()) write(out, d);
  } catch (const NumericsError& e) {
    begin(Answer::numerics_error);
    write(out, e.failure());
  } catch (const std::bad_alloc&) {
    begin(Answer::other);
    out.text(fmt::format("it takes more than {} MiB of memory to read", limits.memory >> 20));
  } catch (const std::exception& e) {
    begin(Answer::other);
    out.text(e.what());
  }
  return out.take();
}

}  // namespace

ChildLimits limits_for_file(const std::string& path) {
  std::error_code none;
  const auto size = std::filesystem::file_size(path, none);
  const double bytes = none ? 0.0 : static_cast<double>(size);
  ChildLimits limits;
  limits.cpu_s += bytes / 20e6;
  limits.memory += static_cast<std::size_t>(8.0 * bytes);
  return limits;
}

std::string in_bounded_child(const std::string& file, const std::function<std::string()>& work, const ChildLimits& limits) {
  const ChildEnd end = run_in_child([&](const Say& say) { say(answer_of(work, limits)); }, limits);
  if (end.how == ChildEnd::How::not_started) refuse(file, fmt::format("no process to read it: {}", std::strerror(end.status)), "");
  if (end.how == ChildEnd::How::late) refuse(file, fmt::format("reading it takes more than {:g} s", limits.wall_s));
  if (end.how == ChildEnd::How::killed && end.status == SIGXCPU)
    refuse(file, fmt::format("reading it takes more than {:g} s of processor time", std::ceil(limits.cpu_s)));
  if (end.how == ChildEnd::How::killed) refuse(file, fmt::format("the library that reads it crashed ({})", strsignal(end.status)));
  if (end.status != 0) refuse(file, "the library that reads it gave up");
  try {
    ByteReader in(end.said);
    switch (static_cast<Answer>(in.number())) {
      case Answer::bytes:
        return end.said.substr(end.said.size() - in.left());
      case Answer::input_error: {
        std::vector<Diagnostic> all(std::min(in.number(), end.said.size()));
        for (Diagnostic& d : all) d = read_diagnostic(in);
        throw InputError(std::move(all));
      }
      case Answer::numerics_error:
        throw NumericsError(read_failure(in));
      default:
        refuse(file, in.text());
    }
  } catch (const std::out_of_range&) {
    refuse(file, "the process that reads it gave half an answer");
  }
}

}  // namespace cardan
