// Claims about the sources that one text alone cannot break: documents name what there is, functions that are offered are used, and
// the form is that of .clang-format.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

namespace fs = std::filesystem;

namespace cardan {
namespace {

struct Source {
  std::string path;  // from the top folder
  std::string text;
};

std::string text_of(const fs::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

bool ends_with_one_of(const std::string& path, std::initializer_list<const char*> endings) {
  return std::any_of(endings.begin(), endings.end(), [&](const std::string& e) { return path.ends_with(e); });
}

/// All text files of ours, but for data of others.
const std::vector<Source>& sources() {
  static const std::vector<Source> all = [] {
    std::vector<Source> out;
    const fs::path top = CARDAN_SOURCE_DIR;
    const auto add = [&](const fs::path& path) {
      const std::string name = fs::relative(path, top).string();
      if (name.find("node_modules") == name.npos && !name.starts_with("tests/reference/")) out.push_back({name, text_of(path)});
    };
    for (const auto& entry : fs::directory_iterator(top))
      if (entry.is_regular_file()) add(entry.path());
    for (const char* folder : {"core", "bodies", "hinges", "plugins", "scripts", "scenarios", "bench", "cmake", "docs", "tests"})
      for (const auto& entry : fs::recursive_directory_iterator(top / folder))
        if (entry.is_regular_file()) add(entry.path());
    std::sort(out.begin(), out.end(), [](const Source& a, const Source& b) { return a.path < b.path; });
    return out;
  }();
  return all;
}

bool is_cpp(const Source& s) { return ends_with_one_of(s.path, {".cpp", ".hpp", ".h"}); }
bool is_document(const Source& s) { return s.path.ends_with(".md") && s.path != "CHANGELOG.md"; }

/// Everything that is no document, one after the other.
const std::string& code() {
  static const std::string all = [] {
    std::string out;
    for (const Source& s : sources())
      if (!s.path.ends_with(".md") && s.path != "tests/architecture/sources_test.cpp") out += s.text + '\n';
    return out;
  }();
  return all;
}

struct Span {
  std::string text, place;
};

/// `like this`, outside of fenced blocks, with the places.
std::vector<Span> code_spans(const Source& document) {
  std::vector<Span> out;
  std::istringstream lines(document.text);
  bool fenced = false;
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    if (line.starts_with("```")) fenced = !fenced;
    for (std::size_t at = 0, end; !fenced && (at = line.find('`', at)) != line.npos && (end = line.find('`', at + 1)) != line.npos;
         at = end + 1)
      out.push_back({line.substr(at + 1, end - at - 1), document.path + ":" + std::to_string(number)});
  }
  return out;
}

TEST(Documents, NameWhatThereIs) {
  // How names are made, examples, and programs of others.
  const std::set<std::string> none_of_ours = {"snake_case", "UpperCamel", "kName",  "h5repack",  "hub_NxM",         "hub_AxM", "p_PQ_E",
                                              "w_AB_E",     "V_AB_E",     "F_Bo_E", "_v4_lanes", "C0999_what.yaml", "level_1", "level_2"};
  const std::regex name(R"([A-Za-z_]\w*((::|\.|:)[A-Za-z_~]\w*)*(\(\))?)"), word(R"([A-Za-z_]\w*)");
  const std::regex place(R"((core|bodies|hinges|plugins|scripts|scenarios|tests|docs|bench|cmake)(/[\w.+-]+)+/?)");
  std::map<std::string, bool> known;
  const auto stands = [&](const std::string& w) {
    const auto [at, fresh] = known.try_emplace(w, false);
    // A name may be put together: "step_ledger_" and the method.
    if (fresh)
      at->second = code().find(w) != std::string::npos || code().find('"' + w.substr(0, w.rfind('_') + 1) + '"') != std::string::npos;
    return at->second;
  };
  const auto is_there = [](const std::string& path) {
    if (fs::exists(fs::path(CARDAN_SOURCE_DIR) / path)) return true;
    return std::any_of(sources().begin(), sources().end(),
                       [&](const Source& s) { return s.path.starts_with(path + ".") || s.path.ends_with("/" + path); });
  };
  int seen = 0;
  for (const Source& document : sources()) {
    if (!is_document(document)) continue;
    for (const Span& span : code_spans(document)) {
      if (std::regex_match(span.text, place)) {
        ++seen;
        EXPECT_TRUE(is_there(span.text)) << span.place << ": there is no " << span.text;
      } else if (std::regex_match(span.text, name) && none_of_ours.count(span.text) == 0 && !is_there(span.text)) {
        ++seen;
        for (std::sregex_iterator w(span.text.begin(), span.text.end(), word), end; w != end; ++w)
          EXPECT_TRUE(stands(w->str()) || w->str().starts_with("lib"))
              << span.place << ": " << span.text << " stands nowhere in the sources";
      }
    }
  }
  EXPECT_GT(seen, 1000);
}

TEST(Documents, CallCommandsThatThereAre) {
  std::set<std::string> verbs, steps;
  const std::regex verb(R"rx(line\.command\(\s*"([a-z-]+)")rx"), step(R"(\n  ([a-z-]+)\))");
  for (const Source& s : sources())
    if (s.path.starts_with("scripts/commands/") && is_cpp(s))
      for (std::sregex_iterator m(s.text.begin(), s.text.end(), verb), end; m != end; ++m) verbs.insert((*m)[1]);
  const std::string dev = text_of(CARDAN_SOURCE_DIR "/dev");
  for (std::sregex_iterator m(dev.begin(), dev.end(), step), end; m != end; ++m) steps.insert((*m)[1]);
  EXPECT_GT(verbs.size(), 8u);
  EXPECT_GT(steps.size(), 5u);
  int seen = 0;
  for (const Source& document : sources()) {
    if (!is_document(document)) continue;
    std::vector<Span> spans = code_spans(document);
    std::istringstream lines(document.text);
    bool fenced = false, shell = false;
    int number = 0;
    for (std::string line; std::getline(lines, line);) {
      ++number;
      if (line.starts_with("```"))
        fenced = !fenced, shell = fenced && (line == "```" || line == "```sh" || line == "```bash");
      else if (shell && std::regex_search(line, std::regex(R"(^(\./dev|(build/)?cardan) )")))
        spans.push_back({line, document.path + ":" + std::to_string(number)});
    }
    for (const Span& span : spans) {
      std::smatch m;
      if (!std::regex_match(span.text, m, std::regex(R"((build/|\./build/)?(cardan|\./dev) ([a-z][a-z-]*)( .*)?)"))) continue;
      ++seen;
      const auto& all = m[2] == "cardan" ? verbs : steps;
      EXPECT_EQ(all.count(m[3]), 1u) << span.place << ": there is no command " << m[3] << " in: " << span.text;
    }
  }
  EXPECT_GT(seen, 40);
}

bool is_letter(char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; }

/// Calls `see(word, rest)` for each word outside of comments; `rest` is what follows it.
template <class F>
void each_word(const std::string& text, F&& see) {
  for (std::size_t i = 0, end; i < text.size(); i = end) {
    end = i + 1;
    if (text.compare(i, 2, "//") == 0) {
      end = std::min(text.find('\n', i), text.size());
    } else if (is_letter(text[i])) {
      while (end < text.size() && is_letter(text[end])) ++end;
      see(text.substr(i, end - i), std::string_view(text).substr(end));
    }
  }
}

/// A function that a header declares and a source file defines is called from elsewhere, or a document tells what it is for.
TEST(Functions, ThatAreOfferedAreUsed) {
  std::map<std::string, std::map<std::string, int>> words;  // of each file
  std::map<std::string, std::set<std::string>> called;      // words before a bracket
  std::map<std::string, int> total;
  for (const Source& s : sources()) {
    if (!is_cpp(s) || s.path.starts_with("tests/")) continue;
    each_word(s.text, [&](const std::string& word, std::string_view rest) {
      ++words[s.path][word], ++total[word];
      if (rest.starts_with("(") && !std::isupper(static_cast<unsigned char>(word[0]))) called[s.path].insert(word);
    });
  }
  std::set<std::string> told;
  for (const Source& s : sources())
    if (is_document(s)) each_word(s.text, [&](const std::string& word, std::string_view) { told.insert(word); });
  // By them tests look into what the program does behind a wall: files are read in a child, damaged, read back; the twin is for tests.
  const std::set<std::string> of_tests = {"modal_data_of", "remove_attribute", "read_integers", "hinge_wrenches"};
  int seen = 0;
  for (const Source& header : sources()) {
    if (!header.path.ends_with(".hpp") || words.count(header.path) == 0) continue;
    const std::string own = header.path.substr(0, header.path.size() - 4) + ".cpp";
    if (words.count(own) == 0) continue;
    for (const std::string& f : called[header.path]) {
      if (words[own][f] == 0) continue;
      ++seen;
      const bool used = total[f] > words[header.path][f] + words[own][f] || words[own][f] > 1 || words[header.path][f] > 1 ||
                        told.count(f) > 0 || of_tests.count(f) > 0;
      EXPECT_TRUE(used) << header.path << ": nothing but tests uses " << f << ", and no document names it";
    }
  }
  EXPECT_GT(seen, 300);
}

/// What clang-format of Debian 12 writes; `./dev format` does it. So is the code that documents print, which stands there to be taken.
TEST(Sources, AreFormatted) {
  const auto said = [](const std::string& command) {
    std::string out;
    if (std::FILE* pipe = ::popen(command.c_str(), "r")) {
      std::array<char, 4096> block;
      for (std::size_t n; (n = std::fread(block.data(), 1, block.size(), pipe)) > 0;) out.append(block.data(), n);
      ::pclose(pipe);
    }
    return out;
  };
  if (said("clang-format --version 2>/dev/null").find("version 14.") == std::string::npos) GTEST_SKIP() << "no clang-format 14";
  std::string files = " '" CARDAN_BINARY_DIR "'/tests/printed/*.cpp";
  for (const Source& s : sources())
    if (is_cpp(s)) files += " '" + s.path + "'";
  const std::string wrong =
      said("cd '" CARDAN_SOURCE_DIR "' && clang-format --dry-run" + files + " 2>&1 | sed -n 's/: warning:.*//p' | sort -u | head -20");
  EXPECT_EQ(wrong, "") << "./dev format mends it";
}

}  // namespace
}  // namespace cardan
