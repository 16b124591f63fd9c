#pragma once
// Files of a test: in a folder of its own process, so that tests may run beside each other; gone when the process ends.
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace cardan {

/// A fresh folder that lives as long as this object.
class TemporaryFolder {
 public:
  TemporaryFolder() : path_((std::filesystem::temp_directory_path() / "cardan-test-XXXXXX").string()), owner_(getpid()) {
    if (!mkdtemp(path_.data())) throw std::runtime_error("no temporary folder");
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    if (getpid() == owner_) std::filesystem::remove_all(path_, ignored);  // not at the end of a forked child
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  pid_t owner_;
};

namespace test {

/// The path of a file (or folder) of this process alone.
inline std::string scratch(const std::string& name) {
  static const TemporaryFolder folder;
  return folder / name;
}

}  // namespace test
}  // namespace cardan
