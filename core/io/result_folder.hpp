#pragma once
// The folder that results go to, and files that appear in it whole or not at all.
#include <filesystem>
#include <functional>
#include <string_view>
#include <vector>

#include "core/base/diagnostic.hpp"

namespace cardan {

/// What was to be written is there, and the disk or the rights do not let it (exit code 4).
class WriteError : public InputError {
 public:
  using InputError::InputError;
};

/// A folder that this process alone writes results to: made where there is none, and held by a lock that ends with the object or, however
/// that ends, with the process.
class ResultFolder {
 public:
  /// Throws InputError C0701: the folder cannot be made, another run holds it, or one of `names` is there and can be no file (a folder,
  /// a device, a pipe). Nothing in the folder is touched.
  ResultFolder(const std::filesystem::path& path, const std::vector<std::string_view>& names);
  /// Takes a folder away that was made for this run and nothing was written to.
  ~ResultFolder();
  ResultFolder(const ResultFolder&) = delete;
  ResultFolder& operator=(const ResultFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(std::string_view name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
  bool made_ = false;
  int descriptor_ = -1;
};

/// Where a file is written before it takes its name: hidden, in the same folder.
std::filesystem::path name_before(const std::filesystem::path& file);

/// Puts `text` in place of what is at `file`: it is written beside it and takes its name when it is whole, so that nobody sees a part of
/// it and a failure leaves what was there; a device or a pipe is written to as it is. Throws WriteError C0701.
void write_whole_file(const std::filesystem::path& file, std::string_view text);

/// Throws InputError C0701 where a result would take the place of the file that it is made from.
void expect_another_file(const std::filesystem::path& result, const std::filesystem::path& source);

/// Calls `read`, which opens the file at `path`; again where it throws C0702 while somebody has the file open or has written to it since,
/// for 5 s at most: in the middle of a flush its structure is neither that of before nor that of after. A damaged file that nobody writes
/// to is refused at once.
void read_between_flushes(const std::filesystem::path& path, const std::function<void()>& read);

}  // namespace cardan
