#include "core/io/result_folder.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <system_error>
#include <thread>

namespace cardan {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void cannot_write(const fs::path& path, std::string expected, std::string got, std::string hint) {
  refuse(Code::cannot_write, {{}, {path.string()}}, std::move(expected), std::move(got), std::move(hint));
}

std::string error_text() { return std::generic_category().message(errno); }

const char* kind_of(fs::file_type type) {
  switch (type) {
    case fs::file_type::directory:
      return "a folder of this name";
    case fs::file_type::fifo:
      return "a pipe of this name";
    case fs::file_type::socket:
      return "a socket of this name";
    default:
      return "a device of this name";
  }
}

/// Readers and writers hold shared locks: this one's own is not to be had then.
bool is_open_elsewhere(const fs::path& path) {
  const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) return false;
  const bool held = flock(descriptor, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  close(descriptor);  // and its lock with it
  return held;
}

}  // namespace

ResultFolder::ResultFolder(const fs::path& path, const std::vector<std::string_view>& names) : path_(path) {
  constexpr const char* kElsewhere = "--out DIR chooses another";
  std::error_code error;
  made_ = fs::create_directories(path, error);
  if (error) cannot_write(path, "a place that can be written to", error.message(), kElsewhere);
  for (const std::string_view name : names) {
    const fs::file_status there = fs::status(path / name, error);
    if (fs::exists(there) && !fs::is_regular_file(there))
      cannot_write(path / name, "a file, or nothing yet", kind_of(there.type()), "take it away, or choose another folder by --out DIR");
  }
  // The lock is on the folder itself, so that no file has to stand for it. Where a file system knows no such locks, runs go on
  // without: they still cannot harm each other's open files, which only lose their names.
  descriptor_ = open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor_ < 0) cannot_write(path, "a folder that can be opened", error_text(), kElsewhere);
  if (flock(descriptor_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
  close(descriptor_);
  cannot_write(path, "a folder that no other run writes to", "a run that is going on",
               "wait for its end, or choose another folder by --out DIR");
}

ResultFolder::~ResultFolder() {
  if (std::error_code not_empty; made_) fs::remove(path_, not_empty);
  close(descriptor_);
}

fs::path name_before(const fs::path& file) { return file.parent_path() / ("." + file.filename().string() + ".new"); }

void write_whole_file(const fs::path& file, std::string_view text) {
  std::error_code ignored;
  const bool in_place = fs::is_character_file(file, ignored) || fs::is_fifo(file, ignored);  // a device, a pipe: nothing takes its place
  const fs::path before = in_place ? file : name_before(file);
  if (!in_place) std::remove(before.c_str());  // of a process that was killed; a pipe would be waited for
  std::FILE* out = std::fopen(before.c_str(), in_place ? "wb" : "wbx");
  bool good = out && std::fwrite(text.data(), 1, text.size(), out) == text.size();
  std::string why = good ? "" : error_text();
  if (out && std::fclose(out) != 0 && good) good = false, why = error_text();
  if (good && !in_place && std::rename(before.c_str(), file.c_str()) != 0) good = false, why = error_text();
  if (good) return;
  if (!in_place) std::remove(before.c_str());
  throw WriteError(
      Diagnostic{Code::cannot_write, {{}, {file.string()}}, "a file that can be written", why, "is the folder there, and is there space?"});
}

void expect_another_file(const fs::path& result, const fs::path& source) {
  if (std::error_code none; fs::equivalent(result, source, none))
    cannot_write(result, "another file than the one that is read", "the same", "choose another name");
}

void read_between_flushes(const fs::path& path, const std::function<void()>& read) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::seconds(5);
  while (true) {
    std::error_code none;
    const auto before = fs::last_write_time(path, none);
    try {
      return read();
    } catch (const InputError& e) {
      if (e.diagnostics().front().code != Code::bad_result_file || Clock::now() > end) throw;
      if (!is_open_elsewhere(path) && fs::last_write_time(path, none) == before) throw;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

}  // namespace cardan
