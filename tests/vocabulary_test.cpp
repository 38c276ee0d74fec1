// The project uses the standard terms of its field: none of the words in vocabulary.tsv occurs in it.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <map>
#include <regex>
#include <set>
#include <vector>

#include "base/file.h"
#include "tests/project.h"
#include "tests/source_text.h"

namespace tessera {
namespace {

enum class Where { text, code, phrase };

struct Rule {
  std::regex word;
  std::string phrase, term;
  Where where;
};

std::vector<std::string> splitAt(const std::string& line, char separator) {
  std::vector<std::string> parts(1);
  for (const char c : line) {
    if (c == separator) {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

std::vector<Rule> readRules(const std::string& table) {
  static const std::map<std::string, Where> kPlaces = {
      {"text", Where::text}, {"code", Where::code}, {"phrase", Where::phrase}};
  std::vector<Rule> rules;
  for (const std::string& line : splitAt(table, '\n')) {
    if (line.empty() || line[0] == '#') continue;
    const std::vector<std::string> columns = splitAt(line, '\t');
    EXPECT_EQ(columns.size(), 3u) << line;
    if (columns.size() != 3 || !kPlaces.contains(columns[2])) {
      ADD_FAILURE() << "vocabulary.tsv: " << line;
      continue;
    }
    Rule rule{{}, columns[0], columns[1], kPlaces.at(columns[2])};
    if (rule.where != Where::phrase) rule.word = std::regex(columns[0], std::regex::optimize);
    rules.push_back(std::move(rule));
  }
  return rules;
}

std::set<std::string> findIdentifiers(const std::string& text) {
  std::set<std::string> names;
  for (size_t begin = 0; begin < text.size();) {
    size_t end = begin;
    while (end < text.size() && isIdentifierCharacter(text[end])) ++end;
    if (end > begin) names.insert(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return names;
}

// Standard words that a rule would take for one of its own.
bool isAllowed(const std::string& word) {
  static const std::set<std::string> kWords = {"indexOf", "lastIndexOf", "instanceOf", "toBeInstanceOf", "valueOf"};
  return kWords.contains(word);
}

// Leaf cards are quads with leaves, a term of computer graphics; cards of an HTML page are one of the web.
bool isAboutOtherCards(const std::string& file) {
  return file.starts_with("src/synth/") || file.starts_with("src/eval/report") ||
         file.starts_with("src/pipeline/run_report") || file == "src/import/importer_test.cpp";
}

class Vocabulary {
 public:
  explicit Vocabulary(std::vector<Rule> rules) : rules_(std::move(rules)) {}

  // Each word of a file that the project does not use, with what it says instead.
  std::vector<std::string> findForbidden(const std::string& file, const std::string& source) {
    std::vector<std::string> forbidden;
    const auto report = [&](const std::string& word, const Rule& rule) {
      forbidden.push_back(fmt::format("{}: \"{}\": use {}", file, word, rule.term));
    };
    const std::string extension = fs::path(file).extension().string();
    const bool isTypeScript = extension == ".ts" || extension == ".mts" || extension == ".mjs" || extension == ".js";
    static const std::set<std::string> kCode = {".cpp", ".h", ".comp", ".glsl", ".vert", ".frag"};
    const std::set<std::string> names = findIdentifiers(source);
    std::set<std::string> inCode;
    if (isTypeScript || kCode.contains(extension)) inCode = findIdentifiers(CodeOfSource(source, isTypeScript).text());
    for (const std::string& name : names) {
      for (const size_t rule : match(name)) {
        if (rules_[rule].where == Where::text || inCode.contains(name)) {
          if (rules_[rule].term == "GPU" && isAboutOtherCards(file)) continue;
          report(name, rules_[rule]);
        }
      }
    }
    for (const Rule& rule : rules_) {
      if (rule.where == Where::phrase && source.find(rule.phrase) != std::string::npos) report(rule.phrase, rule);
    }
    return forbidden;
  }

 private:
  // The rules that an identifier breaks.
  const std::vector<size_t>& match(const std::string& name) {
    const auto [known, isNew] = broken_.try_emplace(name);
    if (isNew && !isAllowed(name)) {
      for (size_t i = 0; i < rules_.size(); ++i) {
        if (rules_[i].where != Where::phrase && std::regex_match(name, rules_[i].word)) known->second.push_back(i);
      }
    }
    return known->second;
  }

  std::vector<Rule> rules_;
  std::map<std::string, std::vector<size_t>> broken_;
};

Vocabulary readVocabulary() {
  return Vocabulary(readRules(readTextFile(kProject / "tests/vocabulary.tsv")));
}

// What the rules are about: the files that people write, without what is built or installed.
std::vector<std::string> listSources() {
  static const std::set<std::string> kExtensions = {".cpp", ".h",  ".ts", ".mts", ".comp", ".glsl",  ".vert", ".frag",
                                                    ".py",  ".sh", ".js", ".mjs", ".md",   ".cmake", ".html", ".css"};
  std::vector<std::string> files;
  for (const char* folder : {"apps", "bench", "cmake", "docs", "shaders", "src", "tests", "tools", "web", "."}) {
    for (auto entry = fs::recursive_directory_iterator(kProject / folder); entry != fs::recursive_directory_iterator();
         ++entry) {
      const std::string name = entry->path().filename().string();
      if (entry->is_directory() && (std::string_view(folder) == "." || name == "node_modules" || name == "dist")) {
        entry.disable_recursion_pending();
      }
      if (!entry->is_regular_file()) continue;
      if (!kExtensions.contains(entry->path().extension().string()) && name != "CMakeLists.txt") continue;
      files.push_back(entry->path().lexically_relative(kProject).lexically_normal().generic_string());
    }
  }
  return files;
}

TEST(Vocabulary, IsTheStandardOneOfTheField) {
  Vocabulary vocabulary = readVocabulary();
  // The table itself; names that settings had; what a reader refuses by its old name; the history of the project.
  const std::set<std::string> tellsOfOldNames = {"src/base/former_settings.cpp",
                                                 "src/base/config_test.cpp",
                                                 "src/tiles/tileset_reader.cpp",
                                                 "src/tiles/tileset_json_test.cpp",
                                                 "web/src/tiles/decode-tileset.ts",
                                                 "web/src/tiles/decode-tileset.test.ts",
                                                 "tests/vocabulary_test.cpp",
                                                 "CHANGELOG.md",
                                                 "bench/same_bytes.py"};
  const std::vector<std::string> files = listSources();
  EXPECT_GT(files.size(), 1000u) << "these are not all files";
  for (const std::string& file : files) {
    if (tellsOfOldNames.contains(file)) continue;
    for (const std::string& word : vocabulary.findForbidden(file, readTextFile(kProject / file))) ADD_FAILURE() << word;
  }
}

TEST(Vocabulary, FindsForbiddenWordsInCodeAndText) {
  Vocabulary vocabulary = readVocabulary();
  const auto count = [&](const std::string& file, const std::string& source) {
    return vocabulary.findForbidden(file, source).size();
  };
  EXPECT_EQ(count("a.cpp", "class Trainee {};"), 1u);
  EXPECT_EQ(count("a.cpp", "// A Trainee is trained."), 1u) << "this word is forbidden in text too";
  EXPECT_EQ(count("a.cpp", "int found = 1;"), 1u);
  EXPECT_EQ(count("a.cpp", "// It was found.\nconst char* text = \"found\";"), 0u) << "this one in code alone";
  EXPECT_EQ(count("a.ts", "const text = `found ${found}`;"), 1u);
  EXPECT_EQ(count("a.ts", "const text = `found ${other}`;"), 0u);
  EXPECT_EQ(count("a.cpp", "bytesOf(part); names.indexOf(part);"), 1u);
  EXPECT_EQ(count("a.md", "on a graphics card"), 1u);
  EXPECT_EQ(count("src/synth/greenery.cpp", "addLeafCard(card);"), 0u);
  EXPECT_EQ(count("a.md", "The processor draws it."), 1u);
}

TEST(CodeOfSource, LeavesOutCommentsStringsAndIncludeLines) {
  const auto code = [](std::string_view source) {
    std::string text = CodeOfSource(source, true).text();
    std::erase(text, ' ');
    return text;
  };
  EXPECT_EQ(code("a // b\nc"), "a\nc");
  EXPECT_EQ(code("a /* b\nb */ c"), "a\nc");
  EXPECT_EQ(code("a(\"b \\\" b\", 'b', 1'000)"), "a(,,1'000)");
  EXPECT_EQ(code("a(R\"x(b )\" b)x\")"), "a()");
  EXPECT_EQ(code("#include \"b.h\"\na"), "\na");
  EXPECT_EQ(code("a(`b ${c + `b ${d}`} b`)"), "a(c+d)");
}

}  // namespace
}  // namespace tessera
