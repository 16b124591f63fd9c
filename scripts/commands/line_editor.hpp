#pragma once
// A line from a person at a terminal: editing, history, completion.
#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cardan {

class LineEditor {
 public:
  struct Completion {
    std::size_t start = 0;  // where the unfinished word begins
    std::vector<std::string> words;
  };
  /// What the words at the end of the text before the cursor may become.
  using Completer = std::function<Completion(std::string_view before_cursor)>;
  enum class Answer { line, interrupt, end };

  /// The history is read from `history`, which need not exist. `interrupt` is what the handler of SIGINT sets.
  LineEditor(const std::filesystem::path& history, Completer completer, const std::atomic<bool>& interrupt);
  ~LineEditor();
  LineEditor(const LineEditor&) = delete;
  LineEditor& operator=(const LineEditor&) = delete;

  Answer read(const std::string& prompt, std::string& line);
  /// Into the history, and its file where that can be written.
  void remember(const std::string& line);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// $XDG_STATE_HOME/cardan/<name>, or below ~/.local/state; empty without a home.
std::filesystem::path state_file(const std::string& name);

}  // namespace cardan
