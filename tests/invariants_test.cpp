// Tests that the tests exist which docs/invariants.md names for the invariants of each representation.
#include <gtest/gtest.h>

#include <regex>
#include <set>
#include <vector>

#include "base/file.h"
#include "tests/project.h"

namespace tessera {
namespace {

std::set<std::string> testsIn(const fs::path& folder) {
  static const std::regex test(R"(\nTEST(?:_[FP])?\(\s*(\w+),\s*(\w+)\))");
  std::set<std::string> names;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    const std::string file = entry.path().filename().string();
    if (entry.path().extension() != ".cpp" || file.find("_test") == std::string::npos) continue;
    const std::string text = readTextFile(entry.path());
    for (auto match = std::sregex_iterator(text.begin(), text.end(), test); match != std::sregex_iterator(); ++match) {
      names.insert((*match)[1].str() + "." + (*match)[2].str());
    }
  }
  return names;
}

// Returns the numbers of the rows in the table of `subject`: a representation's name in backquotes, or all of them.
std::vector<int> provedRows(const std::string& subject) {
  const std::string text = readTextFile(kProject / "docs/invariants.md");
  const size_t from = text.find("\n## Invariants of " + subject + "\n");
  if (from == std::string::npos) return {};
  const std::string section = text.substr(from, text.find("\n## ", from + 1) - from);
  std::set<std::string> tests = testsIn(kProject / "src");
  tests.merge(testsIn(kProject / "tests"));
  static const std::regex row(R"(\n\| (\d+) \|[^\n]*)"), name(R"(`(\w+\.\w+)`)");
  std::vector<int> rows;
  for (auto each = std::sregex_iterator(section.begin(), section.end(), row); each != std::sregex_iterator(); ++each) {
    rows.push_back(std::stoi((*each)[1].str()));
    const std::string line = each->str();
    const auto first = std::sregex_iterator(line.begin(), line.end(), name);
    EXPECT_NE(first, std::sregex_iterator()) << "row " << rows.back() << " names no test";
    for (auto test = first; test != std::sregex_iterator(); ++test) {
      EXPECT_TRUE(tests.contains((*test)[1].str()))
          << "row " << rows.back() << ": there is no test " << (*test)[1].str();
    }
  }
  return rows;
}

TEST(Invariants, AreEachProvedByExistingTests) {
  EXPECT_EQ(provedRows("every representation"), (std::vector<int>{1, 2, 3, 4, 5}));
  EXPECT_EQ(provedRows("`volume`"), (std::vector<int>{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15}));
  EXPECT_EQ(provedRows("`hash`"),
            (std::vector<int>{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19}));
  EXPECT_EQ(provedRows("`mesh`"),
            (std::vector<int>{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24}));
}

}  // namespace
}  // namespace tessera
