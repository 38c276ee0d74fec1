// Runs the program as a user does: its output, the files that it writes, and its exit status.
#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <regex>

#include "base/image_io.h"
#include "base/testing/shared_data.h"
#include "representations/list.h"
#include "tests/program.h"

namespace tessera {
namespace {

using nlohmann::json;

// Settings that train a model in a moment.
const std::vector<std::string> kTinyField = {"grid_levels=4",
                                             "grid_log2_size=10",
                                             "grid_finest=64",
                                             "width=16",
                                             "colour_hidden=1",
                                             "min_step=0.05",
                                             "cone=0.1",
                                             "far=8",
                                             "first_rays=128",
                                             "max_rays=512",
                                             "samples_per_step=2048",
                                             "occupancy_resolution=16",
                                             "occupancy_warmup_steps=16",
                                             "learning_rate=0.02"};

class CommandLine : public testing::Test {
 protected:
  // All tests share one city.
  static void SetUpTestSuite() {
    folder_ = fs::weakly_canonical(fs::temp_directory_path()) / ("tessera-command-line-" + std::to_string(::getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    const Said said = run({"synth", "city", city(), "--blocks", "1x1", "--photos", "10", "--size", "48x36", "--samples",
                           "1", "--seed", "3"});
    ASSERT_EQ(said.exitCode, 0) << said.err;
    EXPECT_TRUE(contains(said.out, "10 photos")) << said.out;
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  static Said run(const std::vector<std::string>& arguments) { return Program(folder_, arguments).wait(); }

  static std::string at(const std::string& name) { return (folder_ / name).string(); }
  static std::string city() { return at("city"); }

  static std::vector<std::string> trainArguments(const std::string& model, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"train", city(), model};
    for (const std::string& setting : kTinyField) arguments.insert(arguments.end(), {"--set", setting});
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  static Said train(const std::string& model, const std::vector<std::string>& more) {
    return run(trainArguments(model, more));
  }
  static Bytes checkpoint(const std::string& model) {
    const json manifest = json::parse(readTextFile(fs::path(model) / "manifest.json"));
    return readFile(fs::path(model) / manifest.at("files").at(0).get<std::string>());
  }
  // A model of a few steps, trained once.
  static std::string model() {
    const std::string modelPath = at("model");
    if (!fs::exists(modelPath)) {
      const Said said = train(modelPath, {"--steps", "6"});
      EXPECT_EQ(said.exitCode, 0) << said.err;
    }
    return modelPath;
  }

  // Writes a camera path that stops at the first three photos of the city; poses are transformed by 2 · (x + (5, 0, 0))
  // unless they are to stay in the source's world.
  static std::string writePath(const std::string& name, bool inSourceWorld) {
    json views = json::array();
    const json capture = json::parse(readTextFile(fs::path(city()) / "transforms.json"));
    for (int i = 0; i < 3; ++i) {
      json matrix = capture.at("frames").at(i).at("transform_matrix");
      if (!inSourceWorld) {
        for (int k = 0; k < 3; ++k) matrix[k][3] = 2 * (matrix[k][3].get<double>() + (k == 0 ? 5 : 0));
      }
      views.push_back({{"camera_to_world", matrix}, {"fov", 50}});
    }
    const json path = {{"camera_path", views}, {"render_width", 24}, {"render_height", 18}, {"fps", 10}};
    writeFileAtomically(at(name), path.dump());
    return at(name);
  }

  // Expects exit code 1 and one line on stderr in the standard form; returns the line.
  static std::string expectFailure(const std::vector<std::string>& arguments) {
    const Said said = run(arguments);
    std::string command;
    for (const std::string& word : arguments) command += word + " ";
    EXPECT_EQ(said.exitCode, 1) << command << said.out << said.err;
    const size_t begin = said.err.find("tessera: error: ");
    EXPECT_NE(begin, std::string::npos) << command << said.err;
    if (begin == std::string::npos) return {};
    const std::string line = said.err.substr(begin);
    EXPECT_TRUE(begin == 0 || said.err[begin - 1] == '\n') << said.err;
    EXPECT_EQ(line.find('\n'), line.size() - 1) << command << "more than one line: " << line;
    EXPECT_TRUE(std::regex_search(line, std::regex("^tessera: error: .+: .+; .+\n$"))) << command << line;
    EXPECT_FALSE(contains(line, "internal")) << command << line;
    return line;
  }
  static std::string expectUsageError(const std::vector<std::string>& arguments) {
    const Said said = run(arguments);
    std::string command;
    for (const std::string& word : arguments) command += word + " ";
    EXPECT_EQ(said.exitCode, 2) << command << said.out << said.err;
    EXPECT_TRUE(said.out.empty()) << command << said.out;
    EXPECT_FALSE(said.err.empty()) << command;
    return said.err;
  }

  static fs::path folder_;
};

fs::path CommandLine::folder_;

TEST_F(CommandLine, HelpOfEveryVerbHasDefaultsAndAnExample) {
  const std::vector<std::vector<std::string>> verbs = {
      {"synth", "city"}, {"import"},           {"train"},          {"bake"},           {"eval"}, {"render"}, {"export"},
      {"info"},          {"bench", "compute"}, {"bench", "train"}, {"bench", "render"}};
  for (std::vector<std::string> verb : verbs) {
    std::string name = "tessera";
    for (const std::string& word : verb) name += " " + word;
    verb.push_back("--help");
    const Said said = run(verb);
    EXPECT_EQ(said.exitCode, 0) << name;
    EXPECT_TRUE(said.err.empty()) << said.err;
    EXPECT_TRUE(contains(said.out, "Example")) << name << "\n" << said.out;
    EXPECT_TRUE(contains(said.out, name + " ")) << name << "\n" << said.out;
    if (verb[0] != "info") {
      EXPECT_TRUE(std::regex_search(said.out, std::regex("\\[[^\\]]+\\]"))) << said.out;
    }
  }
  const Said said = run({"--help"});
  EXPECT_EQ(said.exitCode, 0);
  for (const auto& verb : verbs) EXPECT_TRUE(contains(said.out, "  " + verb[0] + " ")) << said.out;
}

#define NAME(name, Name) #name,
#define SKIP(name, Name)
const std::vector<std::string> kMethods = {TESSERA_REPRESENTATIONS(NAME, NAME)};
const std::vector<std::string> kBakedMethods = {TESSERA_REPRESENTATIONS(SKIP, NAME)};
#undef SKIP
#undef NAME

// Returns, for example, "volume or hash".
std::string joinNames(const std::vector<std::string>& names) {
  std::string sentence;
  for (const std::string& name : names) {
    sentence += (sentence.empty() ? "" : name == names.back() ? " or " : ", ") + name;
  }
  return sentence;
}

TEST_F(CommandLine, ListsTheMethodsThatThereAre) {
  std::string choices;
  for (const std::string& name : kMethods) choices += (choices.empty() ? "" : ",") + name;
  const std::string train = run({"train", "--help"}).out;
  EXPECT_TRUE(contains(train, "--method TEXT:{" + choices + "}")) << train;
  for (const std::string& name : kMethods) EXPECT_TRUE(contains(train, "Settings of --method " + name)) << train;
  EXPECT_TRUE(contains(expectUsageError({"train", city(), at("m"), "--method", "guess"}), "{" + choices + "}"));
  const std::string bake = run({"bake", "--help"}).out;
  EXPECT_TRUE(contains(bake, "of --method " + joinNames(kBakedMethods))) << bake;
}

TEST_F(CommandLine, SaysItsVersion) {
  const Said said = run({"--version"});
  EXPECT_EQ(said.exitCode, 0);
  EXPECT_TRUE(std::regex_search(said.out, std::regex("\\d+\\.\\d+\\.\\d+"))) << said.out;
}

TEST_F(CommandLine, EndsWithTwoWhenItIsUsedWrongly) {
  expectUsageError({});
  EXPECT_TRUE(contains(expectUsageError({"fly"}), "'fly'"));
  expectUsageError({"train"});
  expectUsageError({"train", city()});
  expectUsageError({"train", city(), at("m"), "--stops", "3"});
  expectUsageError({"train", city(), at("m"), "--steps", "many"});
  expectUsageError({"train", city(), at("m"), "--steps", "3", "--minutes", "1"});
  for (const char* minutes : {"-1", "0", "nan", "inf", "1e300", "long"}) {
    expectUsageError({"train", city(), at("m"), "--minutes", minutes});
  }
  for (const char* steps : {"-5", "0", "1.5"}) expectUsageError({"train", city(), at("m"), "--steps", steps});
  expectUsageError({"train", city(), at("m"), "--steps", "3", "--checkpoint-seconds", "-1"});
  expectUsageError({"train", city(), at("m"), "--method", "guess"});
  expectUsageError({"train", city(), at("m"), "--threads", "-3"});
  expectUsageError({"eval", model(), city(), "--split", "best"});
  expectUsageError({"import", city()});
  expectUsageError({"import", city(), at("i"), "--downscale", "0"});
  expectUsageError({"import", city(), at("i"), "--threads", "-1"});
  EXPECT_TRUE(contains(expectUsageError({"import", city(), at("i"), "--mask-command", ""}), "names no program"));
  expectUsageError({"synth", "city", at("none"), "--threads", "-1"});
  expectUsageError({"render", model(), at("r")});
  expectUsageError({"render", model(), at("r"), "--views", city(), "--path", at("path.json")});
  expectUsageError({"render", model(), at("r"), "--views", city(), "--dataparser-transforms", at("transforms.json")});
  expectUsageError({"bench"});
  EXPECT_FALSE(fs::exists(at("m")));
}

TEST_F(CommandLine, RejectsMalformedSizes) {
  for (const char* size : {"640", "640x", "x480", "0x10", "640x480x3", "-1x5", "640 x 480"}) {
    EXPECT_TRUE(contains(expectUsageError({"synth", "city", at("none"), "--size", size}), size));
    EXPECT_TRUE(contains(expectUsageError({"render", model(), at("r"), "--views", city(), "--size", size}), size));
  }
  EXPECT_FALSE(fs::exists(at("none")));
}

TEST_F(CommandLine, ExplainsWhatIsWrongWithAFolder) {
  fs::create_directories(at("empty"));
  EXPECT_TRUE(contains(expectFailure({"import", at("missing"), at("out1")}), at("missing")));
  EXPECT_TRUE(contains(expectFailure({"import", at("empty"), at("out1")}), at("empty")));
  EXPECT_TRUE(contains(expectFailure({"train", at("missing"), at("out1")}), at("missing")));
  EXPECT_TRUE(contains(expectFailure({"train", at("empty"), at("out1")}), "tessera import"));
  EXPECT_TRUE(contains(expectFailure({"info", at("missing")}), at("missing")));
  EXPECT_TRUE(contains(expectFailure({"info", at("empty")}), at("empty")));
  EXPECT_TRUE(contains(expectFailure({"eval", at("empty"), city()}), at("empty")));
  EXPECT_TRUE(contains(expectFailure({"eval", city(), city()}), "tessera train"));
  EXPECT_TRUE(contains(expectFailure({"eval", model(), model()}), model()));
  EXPECT_TRUE(contains(expectFailure({"eval", model(), at("missing")}), at("missing")));
  EXPECT_TRUE(contains(expectFailure({"render", at("missing"), at("out1"), "--views", city()}), at("missing")));
  EXPECT_TRUE(contains(expectFailure({"render", model(), at("out1"), "--path", at("missing.json")}), "missing.json"));
  EXPECT_TRUE(contains(expectFailure(trainArguments(city(), {"--steps", "3"})), "holds a capture"));
  EXPECT_TRUE(contains(expectFailure({"import", city(), at("out1"), "--holdout", "every:1"}), "every:1"));
  EXPECT_TRUE(
      contains(expectFailure({"import", city(), at("out1"), "--holdout", "list:" + at("none.txt")}), "none.txt"));
  EXPECT_FALSE(fs::exists(at("out1")));
  EXPECT_FALSE(fs::exists(at("out1") + "/transforms.json"));
}

TEST_F(CommandLine, SaysWhyAFolderCannotBeServedAndWhatToDo) {
  const auto says = [](const std::string& what, const std::string& answer) {
    EXPECT_EQ(expectFailure({"serve", what}), "tessera: error: " + what + ": " + answer + "\n");
  };
  const std::string another = "; name the folder of a scene, or the world.json of a world";
  says(at("missing"), "there is no such file or folder" + another);
  says(at("missing.json"), "there is no such file or folder" + another);
  fs::create_directories(at("bare"));
  says(at("bare"), "holds neither a scene (tileset.json) nor a world (world.json)" + another);
  writeFileAtomically(at("a.txt"), std::string_view("text"));
  says(at("a.txt"), "is neither the folder of a scene nor a world.json" + another);

  json source = json::parse(readTextFile(fs::path(city()) / "transforms.json"));
  source.erase("tessera");
  writeFileAtomically(at("source/transforms.json"), source.dump());
  says(at("source"),
       "is a folder of photos that are not imported yet, not a scene; import, train and bake them first: tessera "
       "import " +
           at("source") + " CAPTURE, then tessera train CAPTURE MODEL --method " + kBakedMethods.front() +
           ", then tessera bake MODEL SCENE");
  says(city(), "is a capture, not a scene; train and bake it first: tessera train " + city() + " MODEL --method " +
                   kBakedMethods.front() + ", then tessera bake MODEL SCENE");
  says(model(), "is a model of --method field, of which no scene can be baked; train one with --method " +
                    joinNames(kBakedMethods) + ", and bake that; tessera view shows this one");
  const std::string volume = at("volume.model");
  writeFileAtomically(volume + "/blocks.json", std::string_view("{}"));
  says(volume,
       "is a model that is not trained yet, not a scene; train it, then bake it: tessera bake " + volume + " SCENE");
  writeFileAtomically(volume + "/manifest.json",
                      std::string_view(R"({"method":"volume","step":1,"planned_steps":1,"files":["blocks.json"]})"));
  says(volume, "is a model, not a scene; bake it first: tessera bake " + volume + " SCENE");
}

TEST_F(CommandLine, StatesWhichPortsAreValid) {
  for (const char* port : {"99999", "65536", "-1", "x", "8.5", "80x", "99999999999999999999"}) {
    const std::string line = expectUsageError({"serve", at("missing"), "--port", port});
    EXPECT_TRUE(contains(line, std::string("--port: '") + port + "' is not a port")) << line;
    EXPECT_TRUE(contains(line, "from 0 to 65535")) << line;
  }
  for (const char* port : {"0", "65535"}) expectFailure({"serve", at("missing"), "--port", port});
}

TEST_F(CommandLine, ServesUntilItIsInterrupted) {
  fs::create_directories(at("site/scene"));
  writeFileAtomically(at("site/index.html"), std::string_view("viewer"));
  writeFileAtomically(at("site/scene/tileset.json"), std::string_view("{}"));
  const std::string world = at("site/world.json");
  writeFileAtomically(world, std::string_view(R"({"kind":"tessera world","version":2,"scenes":[{"url":"scene"}]})"));
  Program program(folder_, {"serve", world, "--port", "0", "--viewer", at("site")});
  waitUntil(program, [&] { return contains(program.said(), "Ctrl-C"); });
  program.kill(SIGINT);
  const Said said = program.wait();
  EXPECT_EQ(said.exitCode, 0) << said.err;
  EXPECT_TRUE(contains(said.out, world + ": open http://127.0.0.1:")) << said.out;
}

TEST_F(CommandLine, RecognisesAPlainFolderOfPhotosAndSaysWhatToDo) {
  for (int i = 0; i < 3; ++i) writePng(folder_ / "plain" / (std::to_string(i) + ".png"), ImageU8(8, 6, 3, 90));
  EXPECT_TRUE(contains(expectFailure({"import", at("plain"), at("out2")}), "tessera run"));
}

TEST_F(CommandLine, ExplainsWhatIsWrongWithSettings) {
  const auto failure = [&](const std::string& setting) {
    return expectFailure({"train", city(), at("unset"), "--steps", "1", "--set", setting});
  };
  EXPECT_TRUE(contains(failure("learning_rat=3"), "did you mean 'learning_rate'?"));
  EXPECT_TRUE(contains(failure("learning_rate=fast"), "rate requires a number"));
  EXPECT_TRUE(contains(failure("rate"), "rate"));
  EXPECT_TRUE(contains(failure("loss=hinge"), "hinge"));
  EXPECT_TRUE(contains(expectFailure({"train", city(), at("unset"), "--steps", "1", "--seed", "99999999999999999999"}),
                       "seed requires a whole number"));
  writeFileAtomically(folder_ / "wrong.toml", "learning_rate = 1\nwidht = 64\n");
  const std::string file = expectFailure({"train", city(), at("unset"), "--config", at("wrong.toml")});
  EXPECT_TRUE(contains(file, "wrong.toml: line 2")) << file;
  EXPECT_TRUE(contains(file, "did you mean 'width'?")) << file;
  EXPECT_FALSE(fs::exists(at("unset") + "/manifest.json"));
}

TEST_F(CommandLine, ExplainsSettingsThatMakeNoModel) {
  for (const char* setting :
       {"width=17", "grid_features=3", "grid_levels=0", "occupancy_resolution=30", "samples_per_step=0",
        "samples_per_step=-5", "max_rays=0", "density_hidden=0", "min_step=0", "occupancy_every=0", "learning_rate=nan",
        "steps_per_photo=0", "grid_log2_size=60"}) {
    const std::string line = expectFailure({"train", city(), at("unset"), "--steps", "1", "--set", setting});
    const std::string key = std::string(setting).substr(0, std::string(setting).find('='));
    EXPECT_TRUE(contains(line, key)) << setting << ": " << line;
  }
}

TEST_F(CommandLine, DoesNotTouchAModelUnlessToldToGoOn) {
  const Bytes before = checkpoint(model());
  EXPECT_TRUE(contains(expectFailure(trainArguments(model(), {"--steps", "9"})), "--resume"));
  EXPECT_EQ(checkpoint(model()), before);
}

TEST_F(CommandLine, ExplainsModelsThatAreBroken) {
  const auto copied = [&](const std::string& name) {
    fs::copy(model(), at(name), fs::copy_options::recursive);
    return at(name);
  };
  const std::string truncated = copied("truncated");
  const fs::path block = fs::path(truncated) / "blocks/0/step-6.safetensors";
  fs::resize_file(block, fs::file_size(block) / 2);
  EXPECT_TRUE(contains(expectFailure({"eval", truncated, city()}), block.string()));
  EXPECT_TRUE(contains(expectFailure({"train", city(), truncated, "--resume", "--steps", "9"}), block.string()));
  fs::remove(block);
  EXPECT_TRUE(contains(expectFailure({"eval", truncated, city()}), "step-6.safetensors"));

  const std::string unlisted = copied("unlisted");
  fs::remove(fs::path(unlisted) / "manifest.json");
  EXPECT_TRUE(contains(expectFailure({"eval", unlisted, city()}), "manifest.json"));
  EXPECT_TRUE(contains(expectFailure({"render", unlisted, at("r"), "--views", city()}), "manifest.json"));

  const std::string foreign = copied("foreign");
  json manifest = json::parse(readTextFile(fs::path(foreign) / "manifest.json"));
  manifest["method"] = "mesh";
  writeFileAtomically(fs::path(foreign) / "manifest.json", manifest.dump());
  EXPECT_TRUE(
      contains(expectFailure({"train", city(), foreign, "--method", "field", "--resume", "--steps", "9"}), "mesh"));
  EXPECT_TRUE(contains(expectFailure({"train", city(), foreign, "--resume", "--steps", "9"}), foreign));

  const std::string misset = copied("misset");
  writeFileAtomically(fs::path(misset) / "config.toml", "grid_levels = 5\n");
  EXPECT_TRUE(contains(expectFailure({"eval", misset, city()}), "step-6.safetensors"));
}

TEST_F(CommandLine, ExplainsCapturesThatAreBroken) {
  fs::copy(city(), at("cut"), fs::copy_options::recursive);
  const fs::path transforms = folder_ / "cut/transforms.json";
  const std::string whole = readTextFile(transforms);
  writeFileAtomically(transforms, whole.substr(0, whole.size() / 2));
  for (const std::vector<std::string>& command : {std::vector<std::string>{"train", at("cut"), at("out3")},
                                                  {"info", at("cut")},
                                                  {"eval", model(), at("cut")},
                                                  {"import", at("cut"), at("out3")}}) {
    EXPECT_TRUE(contains(expectFailure(command), "transforms.json"));
  }
  writeFileAtomically(transforms, whole);
  const fs::path photo = folder_ / "cut" / json::parse(whole).at("frames").at(2).at("file_path").get<std::string>();
  const Bytes picture = readFile(photo);
  writeFileAtomically(photo, std::span(picture).first(picture.size() / 2));
  std::vector<std::string> command = trainArguments(at("out3"), {"--steps", "3"});
  command[1] = at("cut");
  EXPECT_TRUE(contains(expectFailure(command), photo.filename().string()));
  fs::remove(photo);
  EXPECT_TRUE(contains(expectFailure(command), photo.filename().string()));
}

TEST_F(CommandLine, ChecksAModelAgainstTheCaptureThatItIsUsedWith) {
  fs::copy(city(), at("resplit"), fs::copy_options::recursive);
  const fs::path transforms = folder_ / "resplit/transforms.json";
  json capture = json::parse(readTextFile(transforms));
  const json heldOut = capture.at("test_filenames");
  capture["test_filenames"] = {capture.at("train_filenames").at(0)};
  capture["train_filenames"].erase(0);
  for (const json& name : heldOut) capture["train_filenames"].push_back(name);
  writeFileAtomically(transforms, capture.dump());
  const Said judged = run({"eval", model(), at("resplit"), "--report", at("resplit.html")});
  EXPECT_EQ(judged.exitCode, 0) << judged.err;
  EXPECT_TRUE(contains(judged.err, "1 of the views were trained on")) << judged.err;
  std::vector<std::string> goingOn = trainArguments(model(), {"--steps", "9", "--resume"});
  goingOn[1] = at("resplit");
  EXPECT_TRUE(contains(expectFailure(goingOn), "other photos"));
  EXPECT_FALSE(contains(run({"eval", model(), city(), "--report", at("city.html")}).err, "trained on"));

  const std::string moved = at("moved");
  fs::copy(model(), moved, fs::copy_options::recursive);
  json placement = json::parse(readTextFile(fs::path(moved) / "blocks.json"));
  placement["source_from_world"][3] = 12.5;
  writeFileAtomically(fs::path(moved) / "blocks.json", placement.dump());
  EXPECT_TRUE(contains(expectFailure({"eval", moved, city()}), "its world is not the one"));
  EXPECT_TRUE(contains(expectFailure({"render", moved, at("r"), "--views", city()}), "its world is not the one"));
}

TEST_F(CommandLine, ExplainsWhenItCannotWrite) {
  writeFileAtomically(folder_ / "file", "in the way");
  EXPECT_TRUE(
      contains(expectFailure({"synth", "city", at("file/city"), "--photos", "2", "--size", "16x12"}), at("file")));
  EXPECT_TRUE(contains(expectFailure(trainArguments(at("file/model"), {"--steps", "2"})), at("file")));
  EXPECT_TRUE(contains(expectFailure({"eval", model(), city(), "--json", at("file/eval.json")}), at("file")));
  EXPECT_TRUE(contains(expectFailure({"render", model(), at("file/frames"), "--views", city()}), at("file")));
}

TEST_F(CommandLine, RejectsUnknownDevices) {
  const std::string failure = expectFailure(trainArguments(at("none"), {"--device", "abacus"}));
  EXPECT_TRUE(contains(failure, "--device abacus")) << failure;
  EXPECT_TRUE(contains(failure, "there is no such device")) << failure;
  EXPECT_TRUE(contains(failure, "cpu")) << "the remedy names a device: " << failure;
}

TEST_F(CommandLine, TrainsEvaluatesAndRendersASyntheticCity) {
  const std::string trained = at("whole");
  Said said = train(trained, {"--steps", "12", "--json"});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  const json training = json::parse(said.out);
  EXPECT_EQ(training.at("step"), 12);
  EXPECT_EQ(training.at("finished"), true);
  EXPECT_GT(training.at("psnr"), 3);
  for (const char* file : {"config.toml", "blocks.json", "manifest.json", "metrics.jsonl"}) {
    EXPECT_TRUE(fs::exists(fs::path(trained) / file)) << file;
  }
  const std::string metrics = readTextFile(fs::path(trained) / "metrics.jsonl");
  const json line = json::parse(metrics.substr(0, metrics.find('\n')));
  for (const char* key :
       {"step", "seconds", "loss", "psnr", "rays_per_second", "samples_per_second", "peak_rss_bytes"}) {
    EXPECT_TRUE(line.contains(key)) << key;
  }

  said = run({"eval", trained, city(), "--json", "-", "--report", at("report.html"), "--images", at("images")});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  const json evaluation = json::parse(said.out);
  EXPECT_GT(evaluation.at("psnr"), 3);
  EXPECT_TRUE(evaluation.at("ssim").is_number());
  EXPECT_TRUE(evaluation.at("lpips").is_null());
  EXPECT_TRUE(evaluation.at("seconds_per_frame").is_number());
  EXPECT_TRUE(contains(evaluation.at("device"), "cpu"));
  ASSERT_GT(evaluation.at("views").size(), 0u);
  for (const json& view : evaluation.at("views")) {
    EXPECT_TRUE(view.at("name").is_string());
    EXPECT_TRUE(view.at("psnr").is_number());
    EXPECT_TRUE(view.at("ssim").is_number());
  }
  EXPECT_TRUE(contains(readTextFile(at("report.html")), "<html"));
  EXPECT_FALSE(fs::is_empty(at("images")));

  said = run({"render", trained, at("frames"), "--views", city(), "--size", "24x18"});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  size_t frames = 0;
  for (const auto& entry : fs::recursive_directory_iterator(at("frames"))) {
    if (!entry.is_regular_file()) continue;
    const ImageInfo info = probeImageFile(entry.path());
    EXPECT_EQ(info.width, 24);
    EXPECT_EQ(info.height, 18);
    ++frames;
  }
  EXPECT_EQ(frames, evaluation.at("views").size());

  said = run({"info", trained, "--json"});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  const json about = json::parse(said.out);
  EXPECT_EQ(about.at("kind"), "model");
  EXPECT_EQ(about.at("method"), "field");
  EXPECT_EQ(about.at("step"), 12);
  said = run({"info", city(), "--json"});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  EXPECT_EQ(json::parse(said.out).at("kind"), "capture");
  EXPECT_EQ(json::parse(said.out).at("photos"), 10);
  said = run({"info", trained});
  EXPECT_EQ(said.exitCode, 0);
  EXPECT_TRUE(contains(said.out, "field")) << said.out;
}

TEST_F(CommandLine, FollowsACameraPath) {
  const std::string path = writePath("flights/path.json", true);
  Said said = run({"render", model(), at("flown"), "--path", path});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  EXPECT_TRUE(contains(said.out, "3 frames")) << said.out;
  std::vector<ImageU8> frames;
  for (const char* name : {"flown/00000.png", "flown/00001.png", "flown/00002.png"}) {
    frames.push_back(readImage(at(name)).image);
    EXPECT_EQ(frames.back().width, 24);
    EXPECT_EQ(frames.back().height, 18);
  }
  EXPECT_NE(frames[0].pixels, frames[1].pixels);
  said = run({"render", model(), at("flown-large"), "--path", path, "--size", "32x20"});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  EXPECT_EQ(probeImageFile(at("flown-large/00002.png")).width, 32);
  // The height of the view is that of the path, so that a wider image shows the same in its middle.
  said = run({"render", model(), at("flown-wide"), "--path", path, "--size", "48x18"});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  const ImageU8 wide = readImage(at("flown-wide/00001.png")).image;
  for (int y = 0; y < 18; ++y)
    for (int x = 0; x < 24; ++x) EXPECT_NEAR(wide.at(x + 12, y)[1], frames[1].at(x, y)[1], 1);
  EXPECT_TRUE(contains(expectUsageError({"render", model(), at("none"), "--path", path, "--split", "all"}), "--views"));

  // The same poses in the format of nerfstudio's viewer.
  const std::string moved = writePath("viewer/path.json", false);
  writeFileAtomically(at("moved.json"),
                      std::string_view(R"({"transform": [[1,0,0,5],[0,1,0,0],[0,0,1,0]], "scale": 2})"));
  said = run({"render", model(), at("flown-moved"), "--path", moved, "--dataparser-transforms", at("moved.json")});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  EXPECT_EQ(readImage(at("flown-moved/00001.png")).image.pixels, frames[1].pixels);
  said = run({"render", model(), at("flown-elsewhere"), "--path", moved});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  EXPECT_NE(readImage(at("flown-elsewhere/00001.png")).image.pixels, frames[1].pixels);
  fs::rename(at("moved.json"), at("viewer/dataparser_transforms.json"));
  said = run({"render", model(), at("flown-unused"), "--path", moved});
  EXPECT_TRUE(contains(said.err, "dataparser_transforms.json is not used")) << said.err;
  EXPECT_NE(readImage(at("flown-unused/00001.png")).image.pixels, frames[1].pixels);
  std::string written = readTextFile(moved);
  written.insert(written.find('{') + 1, R"("keyframes": [],)");
  writeFileAtomically(moved, std::string_view(written));
  said = run({"render", model(), at("flown-beside"), "--path", moved});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  EXPECT_TRUE(contains(said.err, "dataparser_transforms.json")) << said.err;
  EXPECT_EQ(readImage(at("flown-beside/00001.png")).image.pixels, frames[1].pixels);
  const std::string wrong =
      expectFailure({"render", model(), at("none"), "--path", path, "--dataparser-transforms", path});
  EXPECT_TRUE(contains(wrong, "flights/path.json")) << wrong;
  EXPECT_FALSE(fs::exists(at("none")));
}

TEST_F(CommandLine, RendersACameraPathAsAVideo) {
  if (!isInPath("ffmpeg")) GTEST_SKIP() << "ffmpeg is not installed: videos are not tested";
  const Said said = run({"render", model(), at("film/flight.mp4"), "--path", writePath("film.json", true)});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  const std::string film = readTextFile(at("film/flight.mp4"));
  EXPECT_EQ(film.substr(4, 4), "ftyp");
  EXPECT_TRUE(contains(film, "avc1"));
  EXPECT_EQ(std::distance(fs::directory_iterator(at("film")), fs::directory_iterator()), 1);
}

TEST_F(CommandLine, EndsWithTheSameBytesHoweverOftenItIsKilled) {
  Said said = train(at("unbroken"), {"--steps", "150", "--threads", "1"});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  int killed = 0;
  for (const int milliseconds : {0, 40, 90, 170}) {
    Program program(folder_, trainArguments(at("killed"), {"--steps", "150", "--resume", "--checkpoint-seconds", "0"}));
    waitForFile(program, folder_ / "killed/manifest.json");
    std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
    program.kill(SIGKILL);
    killed += program.wait().exitCode == 128 + SIGKILL;
  }
  EXPECT_GT(killed, 0);
  said = train(at("killed"), {"--steps", "150", "--resume", "--threads", "2"});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  EXPECT_EQ(checkpoint(at("killed")), checkpoint(at("unbroken")));
}

TEST_F(CommandLine, SavesAndTellsWhenItIsInterrupted) {
  std::signal(SIGHUP, SIG_DFL);  // with `nohup`, it would be ignored
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    const std::string name = at("interrupted-" + std::to_string(signal));
    Program program(folder_, trainArguments(name, {"--steps", "100000000"}));
    waitForFile(program, name + "/blocks.json");
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    program.kill(signal);
    program.kill(signal);  // by the same parent at once, as a run that passes on what both have received
    const Said said = program.wait();
    EXPECT_EQ(said.exitCode, 128 + signal) << said.err;
    EXPECT_TRUE(contains(said.out, "stopped on request; go on with --resume")) << said.out;
    EXPECT_FALSE(contains(said.err, "error")) << said.err;
    const json manifest = json::parse(readTextFile(fs::path(name) / "manifest.json"));
    EXPECT_EQ(manifest.at("planned_steps"), 100000000);
    EXPECT_FALSE(checkpoint(name).empty());
  }
}

TEST_F(CommandLine, ImportsPhotographsFromTheWild) {
  SKIP_WITHOUT_SHARED_DATA("fox");
  SKIP_WITHOUT_SHARED_DATA("brighton_beach");
  for (const char* name : {"fox", "brighton_beach"}) {
    Said said = run({"import", sharedData(name).string(), at(name), "--downscale", "8"});
    ASSERT_EQ(said.exitCode, 0) << said.err;
    EXPECT_TRUE(contains(said.out, std::string(name) == "fox" ? "50 photos" : "18 photos")) << said.out;
    said = run({"info", at(name), "--json"});
    EXPECT_EQ(json::parse(said.out).at("kind"), "capture");
    EXPECT_GT(json::parse(said.out).at("test"), 0);
  }
}

#ifdef TESSERA_HAS_WINDOW
TEST_F(CommandLine, ViewIsAnsweredByAProgramOfItsOwn) {
  const Said help = run({"view", "--help"});
  EXPECT_EQ(help.exitCode, 0) << help.err;
  for (const char* flag : {"tessera view [OPTIONS] what", "--views", "--detail", "--device", "--screenshot"}) {
    EXPECT_TRUE(contains(help.out, flag)) << flag << "\n" << help.out;
  }
  const Said missing = run({"view", at("missing")});
  EXPECT_EQ(missing.exitCode, 1);
  EXPECT_EQ(missing.err, "tessera: error: " + at("missing") +
                             ": there is no such folder or file; name the folder of a scene or of a model, or a "
                             "world.json\n");
  EXPECT_EQ(run({"view"}).exitCode, 2);
  EXPECT_EQ(run({"view", city(), "--size", "wide"}).exitCode, 2);
  const Said capture = run({"view", city()});
  EXPECT_TRUE(contains(capture.err, "holds neither a scene (tileset.json) nor a model (blocks.json)")) << capture.err;
}
#endif

}  // namespace
}  // namespace tessera
