#pragma once
// Work on a file that may break the library which reads it, in a process of its own: HDF5 1.10 crashes, or computes for
// ever, on a file whose bytes were changed. The child answers with bytes; what it cannot answer becomes an InputError.
#include <cstddef>
#include <functional>
#include <stdexcept>
#include <string>
#include <utility>

#include "core/base/child_process.hpp"

namespace cardan {

/// Enough to read a sound file of this size on a slow machine.
ChildLimits limits_for_file(const std::string& path);

/// What `work` returns, computed in a child process. InputError and NumericsError thrown by it are thrown here again. A
/// child that crashes, exceeds a limit or throws anything else: InputError C0702 that names `file` and tells why.
std::string in_bounded_child(const std::string& file, const std::function<std::string()>& work, const ChildLimits& limits);

/// Numbers and texts in a row of bytes, as a child answers.
class ByteWriter {
 public:
  void number(std::size_t value) { raw(&value, sizeof value); }
  void text(const std::string& value) {
    number(value.size());
    bytes_ += value;
  }
  void raw(const void* data, std::size_t size) { bytes_.append(static_cast<const char*>(data), size); }
  std::string take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

/// The same read again. Throws std::out_of_range where there is no more.
class ByteReader {
 public:
  explicit ByteReader(const std::string& bytes) : bytes_(bytes) {}
  std::size_t number() {
    std::size_t value = 0;
    raw(&value, sizeof value);
    return value;
  }
  std::string text() {
    std::string value(check(number()), '\0');
    raw(value.data(), value.size());
    return value;
  }
  void raw(void* to, std::size_t size) {
    bytes_.copy(static_cast<char*>(to), check(size), at_);
    at_ += size;
  }
  std::size_t left() const { return bytes_.size() - at_; }

 private:
  std::size_t check(std::size_t size) const {
    if (size > left()) throw std::out_of_range("ByteReader");
    return size;
  }
  const std::string& bytes_;
  std::size_t at_ = 0;
};

}  // namespace cardan
