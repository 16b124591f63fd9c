#pragma once
// The built program, run as a user does.
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/scratch.hpp"

namespace cardan {

inline const std::string kScripts = CARDAN_SOURCE_DIR "/tests/scripts", kMissions = kScripts + "/missions";
inline const std::string kSlew = CARDAN_SOURCE_DIR "/scenarios/01_flexible_slew";

struct Finished {
  int exit_code;  // -1: ended by a signal
  std::string out, err;
};

/// Runs `cardan` with these arguments in `folder`; `in_child` is called in the new process before it begins.
Finished run_program(const std::vector<std::string>& arguments, const std::string& folder, const std::function<void()>& in_child = {});

/// The same, while it goes on; killed at the end of the scope if it still does.
class Started {
 public:
  Started(const std::vector<std::string>& arguments, const std::string& folder, const std::function<void()>& in_child = {});
  ~Started();
  Started(const Started&) = delete;
  Started& operator=(const Started&) = delete;
  void send(int signal) const;
  bool has_ended() const;
  Finished wait();

 private:
  std::unique_ptr<TemporaryFolder> texts_;
  int child_ = -1;
};

/// Looks until `happened()`; false if it has not within two minutes.
bool wait_until(const std::function<bool()>& happened);

std::string file_text(const std::string& path);
void write(const std::string& path, const std::string& text);
/// Of the results in the folder `out`.
nlohmann::json summary_of(const std::string& out);
/// All channels and the times, by their paths.
std::map<std::string, std::vector<double>> channels_of(const std::string& out);
/// Names and bytes of all files in the folder `path`; of a folder in it the name alone.
std::map<std::string, std::string> content_of(const std::string& path);
bool has(const std::string& text, const std::string& part);
std::string replaced(std::string text, const std::string& what, const std::string& with);

/// A scenario of a pendulum in `dir`, with this script.
void make_scenario(const TemporaryFolder& dir, const std::string& mission);

}  // namespace cardan
