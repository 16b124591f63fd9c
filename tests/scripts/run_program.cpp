#include "tests/scripts/run_program.hpp"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "core/io/hdf5_file.hpp"

namespace cardan {

Finished run_program(const std::vector<std::string>& arguments, const std::string& folder, const std::function<void()>& in_child) {
  return Started(arguments, folder, in_child).wait();
}

Started::Started(const std::vector<std::string>& arguments, const std::string& folder, const std::function<void()>& in_child)
    : texts_(std::make_unique<TemporaryFolder>()) {
  const std::string out = *texts_ / "out", err = *texts_ / "err", program = CARDAN_BINARY_DIR "/cardan";
  std::vector<char*> argv{const_cast<char*>(program.c_str())};
  for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
  argv.push_back(nullptr);
  child_ = fork();
  if (child_ < 0) throw std::runtime_error("fork failed");
  if (child_ == 0) {
    const int o = open(out.c_str(), O_CREAT | O_WRONLY, 0600), e = open(err.c_str(), O_CREAT | O_WRONLY, 0600);
    if (dup2(o, STDOUT_FILENO) < 0 || dup2(e, STDERR_FILENO) < 0 || chdir(folder.c_str()) != 0) _exit(99);
    signal(SIGINT, SIG_DFL);  // which shells have what runs in the background ignore
    if (in_child) in_child();
    execv(program.c_str(), argv.data());
    _exit(99);
  }
}

Started::~Started() {
  if (child_ <= 0) return;
  kill(child_, SIGKILL);
  waitpid(child_, nullptr, 0);
}

void Started::send(int signal) const { kill(child_, signal); }

bool Started::has_ended() const {
  siginfo_t none{};
  return waitid(P_PID, static_cast<id_t>(child_), &none, WEXITED | WNOHANG | WNOWAIT) == 0 && none.si_pid != 0;
}

Finished Started::wait() {
  int status = 0;
  waitpid(std::exchange(child_, -1), &status, 0);
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, file_text(*texts_ / "out"), file_text(*texts_ / "err")};
}

bool wait_until(const std::function<bool()>& happened) {
  for (int i = 0; i < 12000; ++i) {
    if (happened()) return true;
    usleep(10'000);
  }
  return false;
}

std::string file_text(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void write(const std::string& path, const std::string& text) { std::ofstream(path) << text; }

nlohmann::json summary_of(const std::string& out) { return nlohmann::json::parse(file_text(out + "/summary.json")); }

std::map<std::string, std::vector<double>> channels_of(const std::string& out) {
  const Hdf5File file = Hdf5File::open(out + "/run.h5");
  std::map<std::string, std::vector<double>> all{{"/time", file.read_doubles("/time").values}};
  for (const std::string& path : file.datasets("/channels")) all[path] = file.read_doubles(path).values;
  return all;
}

std::map<std::string, std::string> content_of(const std::string& path) {
  std::map<std::string, std::string> all;
  for (const auto& entry : std::filesystem::directory_iterator(path))
    all[entry.path().filename()] = entry.is_regular_file() ? file_text(entry.path()) : "";
  return all;
}

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

std::string replaced(std::string text, const std::string& what, const std::string& with) {
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += with.size()) text.replace(at, what.size(), with);
  return text;
}

void make_scenario(const TemporaryFolder& dir, const std::string& mission) {
  std::filesystem::copy(kScripts + "/errors/pendulum.yaml", dir / "vehicle.yaml");
  write(dir / "scenario.lua", mission);
}

}  // namespace cardan
