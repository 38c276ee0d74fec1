#include "modules/cmake_targets.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <regex>

namespace tessera {
namespace {

struct Command {
  std::string name;
  std::vector<std::string> arguments;
};

std::vector<Command> parseCommands(std::string_view listFile) {
  static const std::regex comment("#[^\n]*"), command(R"((\w+)\s*\(([^()]*)\))"), word(R"([^\s"]+)");
  // Quoted arguments here are definitions and regular expressions, which name no targets and may contain brackets.
  static const std::regex quoted(R"("(?:[^"\\]|\\.)*")"), generated(R"(\$<[^\s]*>)");
  std::string text = std::regex_replace(std::string(listFile), quoted, "");
  text = std::regex_replace(std::regex_replace(text, comment, ""), generated, "");
  std::vector<Command> commands;
  for (std::sregex_iterator it(text.begin(), text.end(), command), end; it != end; ++it) {
    const std::string arguments = (*it)[2].str();
    Command& parsed = commands.emplace_back();
    parsed.name = (*it)[1].str();
    for (std::sregex_iterator each(arguments.begin(), arguments.end(), word); each != end; ++each) {
      parsed.arguments.push_back(each->str());
    }
  }
  return commands;
}

// Returns the words of a call by the keyword that they follow; those before any keyword under "".
std::map<std::string, std::vector<std::string>> byKeyword(const std::vector<std::string>& arguments) {
  static const std::regex keyword("[A-Z][A-Z_]+");
  std::map<std::string, std::vector<std::string>> words;
  std::string current;
  for (const std::string& argument : arguments) {
    if (std::regex_match(argument, keyword)) {
      current = argument;
    } else {
      words[current].push_back(argument);
    }
  }
  return words;
}

constexpr std::string_view kPrefix = "tessera_";

std::string withoutPrefix(const std::string& name) {
  return name.starts_with(kPrefix) ? name.substr(kPrefix.size()) : name;
}

class Reader {
 public:
  Reader(std::string folder, CmakeTargets& targets) : folder_(std::move(folder)), targets_(targets) {}

  void read(const Command& command) {
    if (command.arguments.empty()) return;
    if (command.name == "tessera_module") readModule(command);
    if (command.name == "tessera_representation") readRepresentation(command);
    if (command.name == "add_library" || command.name == "add_executable") {
      add(withoutPrefix(command.arguments[0]), {command.arguments.begin() + 1, command.arguments.end()}, {});
    }
    if (command.name != "target_link_libraries") return;
    for (const std::string& argument : command.arguments) {
      if (argument.starts_with(kPrefix))
        targets_[withoutPrefix(command.arguments[0])].links.insert(withoutPrefix(argument));
    }
    targets_[withoutPrefix(command.arguments[0])].links.erase(withoutPrefix(command.arguments[0]));
  }

 private:
  CmakeTarget& add(const std::string& name, const std::vector<std::string>& sources,
                   const std::vector<std::string>& links) {
    CmakeTarget& target = targets_[name];
    target.folder = folder_;
    for (const std::string& source : sources) {
      const std::string path = (std::filesystem::path(folder_) / source).lexically_normal().string();
      if (path.ends_with(".cpp")) target.sources.push_back(path);
    }
    target.links.insert(links.begin(), links.end());
    return target;
  }

  void addTests(const std::string& module, const std::vector<std::string>& tests,
                const std::vector<std::string>& links) {
    if (!tests.empty()) add(module + "_test", tests, links).isTest = true;
  }

  void readModule(const Command& command) {
    auto words = byKeyword(command.arguments);
    const std::string name = words[""].front();
    add(name, words["SOURCES"], words["USES"]);
    addTests(name, words["TESTS"], {name});
  }

  void readRepresentation(const Command& command) {
    auto words = byKeyword(command.arguments);
    const std::string name = words[""].front();
    std::vector<std::string> parts;
    for (const std::string keyword : {"CONTENT", "CPU", "VULKAN", "TRAIN"}) {
      if (words[keyword].empty()) continue;
      std::string part = name + "_" + keyword;
      std::transform(part.begin() + static_cast<ptrdiff_t>(name.size()), part.end(),
                     part.begin() + static_cast<ptrdiff_t>(name.size()),
                     [](unsigned char c) { return std::tolower(c); });
      CmakeTarget& target = add(part, words[keyword], words[keyword + "_USES"]);
      if (!parts.empty() && !words["CONTENT"].empty()) target.links.insert(name + "_content");
      parts.push_back(part);
    }
    parts.insert(parts.end(), words["TEST_USES"].begin(), words["TEST_USES"].end());
    std::vector<std::string> tests = words["TESTS"];
    tests.insert(tests.end(), words["VULKAN_TESTS"].begin(), words["VULKAN_TESTS"].end());
    addTests("representation_" + name, tests, parts);
  }

  std::string folder_;
  CmakeTargets& targets_;
};

}  // namespace

void addCmakeTargets(const std::string& folder, std::string_view listFile, CmakeTargets& targets) {
  Reader reader(folder, targets);
  for (const Command& command : parseCommands(listFile)) reader.read(command);
}

std::set<std::string> linkedBy(const CmakeTargets& targets, const std::string& name) {
  std::set<std::string> linked;
  std::vector<std::string> open = {name};
  while (!open.empty()) {
    const auto it = targets.find(open.back());
    open.pop_back();
    if (it == targets.end()) continue;
    for (const std::string& link : it->second.links) {
      if (linked.insert(link).second) open.push_back(link);
    }
  }
  return linked;
}

}  // namespace tessera
