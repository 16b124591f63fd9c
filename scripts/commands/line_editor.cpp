#include "scripts/commands/line_editor.hpp"

#include <histedit.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <clocale>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cwchar>

namespace cardan {
namespace {

constexpr int kRemembered = 1000;  // lines
constexpr std::size_t kWidth = 80;

}  // namespace

struct LineEditor::Impl {
  std::filesystem::path file;
  Completer completer;
  const std::atomic<bool>& interrupt;
  std::string prompt;
  EditLine* editor = nullptr;
  History* history_ = nullptr;

  static Impl& of(EditLine* editor) {
    void* self = nullptr;
    el_get(editor, EL_CLIENTDATA, &self);
    return *static_cast<Impl*>(self);
  }
  static char* prompt_of(EditLine* editor) { return of(editor).prompt.data(); }

  /// Waits for input; false if it was interrupted. SIGINT comes through while it waits and at no other time here, so that none
  /// goes unnoticed between the look at the flag and the wait.
  bool wait() {
    sigset_t interrupts, before;
    sigemptyset(&interrupts);
    sigaddset(&interrupts, SIGINT);
    sigprocmask(SIG_BLOCK, &interrupts, &before);
    pollfd input{STDIN_FILENO, POLLIN, 0};
    while (!interrupt && ppoll(&input, 1, nullptr, &before) < 0 && errno == EINTR) {
    }
    sigprocmask(SIG_SETMASK, &before, nullptr);
    return !interrupt;
  }

  /// One character of the terminal; unlike the library's own, it gives up when it is interrupted.
  static int read_character(EditLine* editor, wchar_t* out) {
    std::mbstate_t state{};
    for (;;) {
      char byte = 0;
      if (!of(editor).wait()) return -1;
      const ssize_t n = ::read(STDIN_FILENO, &byte, 1);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) return static_cast<int>(n);
      if (byte == 0) continue;  // what is left of a Ctrl-D from before the terminal was ready
      const std::size_t used = std::mbrtowc(out, &byte, 1, &state);
      if (used == static_cast<std::size_t>(-2)) continue;  // more bytes follow
      if (used == static_cast<std::size_t>(-1)) state = {}, *out = L'?';
      return 1;
    }
  }

  static unsigned char complete(EditLine* editor, int) {
    const LineInfo* line = el_line(editor);
    const std::string_view before(line->buffer, static_cast<std::size_t>(line->cursor - line->buffer));
    const Completion c = of(editor).completer(before);
    if (c.words.empty()) return CC_REFRESH_BEEP;
    std::string common = c.words.front();
    for (const std::string& word : c.words)
      common.resize(static_cast<std::size_t>(std::mismatch(common.begin(), common.end(), word.begin(), word.end()).first - common.begin()));
    const std::string rest = common.substr(std::min(common.size(), before.size() - c.start));
    if (!rest.empty()) return el_insertstr(editor, rest.c_str()) == 0 ? CC_REFRESH : CC_ERROR;
    if (c.words.size() == 1) return CC_NORM;
    list(c.words);
    return CC_REDISPLAY;
  }

  static void list(const std::vector<std::string>& words) {
    std::size_t width = 0;
    for (const std::string& word : words) width = std::max(width, word.size() + 2);
    const std::size_t per_line = std::max<std::size_t>(1, kWidth / width);
    for (std::size_t i = 0; i < words.size(); ++i)
      std::printf("%s%-*s", i % per_line == 0 ? "\n" : "", static_cast<int>(width), words[i].c_str());
    std::printf("\n");
    std::fflush(stdout);
  }
};

LineEditor::LineEditor(const std::filesystem::path& history_file, Completer completer, const std::atomic<bool>& interrupt)
    : impl_(new Impl{history_file, std::move(completer), interrupt, {}}) {
  std::setlocale(LC_CTYPE, "");  // numbers stay as they are
  EditLine*& e = impl_->editor;
  History*& h = impl_->history_;
  HistEvent event;
  h = history_init();
  history(h, &event, H_SETSIZE, kRemembered);
  history(h, &event, H_SETUNIQUE, 1);
  if (!impl_->file.empty()) history(h, &event, H_LOAD, impl_->file.c_str());
  e = el_init("cardan", stdin, stdout, stderr);
  el_set(e, EL_CLIENTDATA, impl_.get());
  el_set(e, EL_PROMPT, &Impl::prompt_of);
  el_set(e, EL_EDITOR, "emacs");
  el_set(e, EL_HIST, history, h);
  el_set(e, EL_GETCFN, &Impl::read_character);
  el_wset(e, EL_ADDFN, L"cardan-complete", L"complete a name",
          &Impl::complete);  // of narrow texts libedit keeps copies and never frees them
  el_set(e, EL_BIND, "^I", "cardan-complete", nullptr);
  el_set(e, EL_BIND, "^R", "em-inc-search-prev", nullptr);
  el_source(e, nullptr);  // ~/.editrc
}

LineEditor::~LineEditor() {
  el_end(impl_->editor);
  history_end(impl_->history_);
}

LineEditor::Answer LineEditor::read(const std::string& prompt, std::string& line) {
  impl_->prompt = prompt;
  el_resize(impl_->editor);
  int n = 0;
  const char* text = el_gets(impl_->editor, &n);
  if (!text || n <= 0) {
    std::printf("\n");
    return impl_->interrupt ? Answer::interrupt : Answer::end;
  }
  line.assign(text, static_cast<std::size_t>(n));
  while (!line.empty() && (line.back() == '\n' || line.back() == '\r')) line.pop_back();
  return Answer::line;
}

void LineEditor::remember(const std::string& line) {
  if (line.find_first_not_of(' ') == std::string::npos) return;
  HistEvent event;
  history(impl_->history_, &event, H_ENTER, line.c_str());
  if (impl_->file.empty()) return;
  std::error_code ignored;
  std::filesystem::create_directories(impl_->file.parent_path(), ignored);
  history(impl_->history_, &event, H_SAVE, impl_->file.c_str());
}

std::filesystem::path state_file(const std::string& name) {
  const char *state = std::getenv("XDG_STATE_HOME"), *home = std::getenv("HOME");
  if (state && *state) return std::filesystem::path(state) / "cardan" / name;
  if (home && *home) return std::filesystem::path(home) / ".local/state/cardan" / name;
  return {};
}

}  // namespace cardan
