#include "photogrammetry/video_frames.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <span>

#include "base/child_process.h"
#include "base/error.h"
#include "base/file_digest.h"
#include "base/image_io.h"
#include "base/log.h"
#include "base/output_pipe.h"
#include "photogrammetry/frame_choice.h"

namespace tessera {
namespace {

constexpr size_t kFewestFramesOfVideo = 3;
constexpr int kLookedAtSide = 640;  // pixels of the longer side: motion that blurs more than one of them counts
constexpr int kJpegQuality = 95;
constexpr size_t kFramesAtOnce = 2000;  // an argument of a program has at most 128 KiB
constexpr const char* kInstall = "install it: apt-get install ffmpeg";

std::string lastLine(const ChildProcess& process) {
  const std::string words = process.lastWords();
  return words.substr(words.rfind('\n') == words.npos ? 0 : words.rfind('\n') + 1);
}

// The numbers of the chosen frames, ascending; none if there is no list, or a damaged one, or one of another origin.
std::vector<int64_t> readChosen(const fs::path& file, const std::string& origin) {
  std::error_code status;
  if (!fs::is_regular_file(file, status)) return {};
  constexpr uint64_t kMaxBytes = 1 << 26;
  const auto json = nlohmann::json::parse(readTextFile(file, kMaxBytes), nullptr, false);
  if (!json.is_object() || !json.contains("origin") || json["origin"] != origin) return {};
  if (!json.contains("frames") || !json["frames"].is_array()) return {};
  std::vector<int64_t> numbers;
  for (const auto& frame : json["frames"]) {
    if (!frame.is_object() || !frame.contains("number") || !frame["number"].is_number_unsigned()) return {};
    numbers.push_back(frame["number"].get<int64_t>());
    if (numbers.size() > 1 && numbers.back() <= numbers[numbers.size() - 2]) return {};
  }
  return numbers;
}

// Returns an expression of ffmpeg that is 1 for these frames, in ascending order, and 0 for others. It is a tree: a sum
// of more than about a hundred terms is refused.
std::string selectFrames(std::span<const int64_t> frames) {
  if (frames.size() == 1) return fmt::format("eq(n,{})", frames[0]);
  const size_t middle = frames.size() / 2;
  return fmt::format("if(lt(n,{}),{},{})", frames[middle], selectFrames(frames.first(middle)),
                     selectFrames(frames.subspan(middle)));
}

// Whether a file is a frame, or was to become one: other files, such as masks, belong to the user.
bool isFrame(std::string_view name) {
  constexpr std::string_view kBegin = "frame_", kEnd = ".jpg";
  if (!name.starts_with(kBegin)) return false;
  name.remove_prefix(kBegin.size());
  name.remove_prefix(std::min(name.size(), name.find_first_not_of("0123456789")));
  return name == kEnd || name.starts_with(".jpg.partial-");
}

}  // namespace

// A run of ffmpeg that writes pictures to its standard output.
struct VideoFrames::Decoding {
  OutputPipe pipe;
  ChildProcess process;
  std::string program;
  fs::path video;

  Decoding(std::vector<std::string> arguments, fs::path of) : program(arguments.at(0)), video(std::move(of)) {
    const std::string failure = process.start(std::move(arguments), {.output = pipe.writeEnd(), .hasOwnGroup = true});
    if (!failure.empty()) throw Error(program, "", "cannot be run: " + failure, kInstall);
  }

  // Returns whether there was another picture.
  bool next(ImageU8& picture, const std::function<void()>& watch) {
    std::string text;
    std::byte byte{};
    for (int lines = 0; lines < 3 && text.size() < kMaxPnmHeader; lines += byte == std::byte{'\n'}) {
      if (pipe.read({&byte, 1}, watch) == 0) break;
      text += static_cast<char>(byte);
    }
    if (text.empty()) return false;
    const auto header = parsePnmHeader(text);
    if (!header) throw Error(program, "", "writes no pictures", kInstall);
    picture.width = header->width;
    picture.height = header->height;
    picture.channels = header->channels;
    const size_t size = picture.pixelCount() * static_cast<size_t>(header->channels);
    // Memory grows with what comes, not with what the header says.
    constexpr size_t kBytesAtOnce = size_t{1} << 24;
    picture.pixels.resize(std::min(size, picture.pixels.size()));
    for (size_t done = 0; done < size;) {
      const size_t part = std::min(size - done, kBytesAtOnce);
      picture.pixels.resize(std::max(picture.pixels.size(), done + part));
      if (pipe.read(std::as_writable_bytes(std::span(picture.pixels).subspan(done, part)), watch) < part) return false;
      done += part;
    }
    return true;
  }

  // Waits for the end of the program. Returns what it complained of last, or nothing.
  std::string finish() {
    const std::string end = process.wait();
    if (!end.empty()) {
      throw Error(video.string(), "", fmt::format("{} {}: {}", program, end, lastLine(process)),
                  "check that the video plays, and the free space; run again to go on");
    }
    return lastLine(process);
  }
};

VideoFrames::VideoFrames(fs::path video, fs::path folder, VideoFrameOptions options)
    : video_(std::move(video)), folder_(std::move(folder)), options_(std::move(options)) {}

std::string VideoFrames::frameFile(int64_t frame) const {
  return (folder_ / fmt::format("frame_{:06}.jpg", frame)).string();
}

std::string VideoFrames::origin() const {
  return fmt::format("{} {}", fileDigest(video_), options_.count);
}

// With "file:" and an absolute path, no name can be mistaken for an option or a protocol, and a list of files that
// calls itself a video reads nothing from the network.
std::vector<std::string> VideoFrames::command(const std::string& program) const {
  std::vector<std::string> words{program, "-hide_banner", "-loglevel", "error", "-protocol_whitelist", "file"};
  if (program == options_.program) {
    words.insert(words.end(), {"-nostdin", "-y"});
    if (options_.threads > 0) words.insert(words.end(), {"-threads", std::to_string(options_.threads)});
  }
  words.insert(words.end(), {"-i", "file:" + fs::absolute(video_).string()});
  return words;
}

VideoStream VideoFrames::inspect(const Watch& watch) {
  if (stream_) return *stream_;
  std::vector<std::string> arguments = command(options_.probe);
  // V: no cover pictures.
  arguments.insert(
      arguments.end(),
      {"-select_streams", "V:0", "-show_entries",
       "stream=width,height,nb_frames,duration,avg_frame_rate,color_transfer:format=duration", "-of", "json"});
  OutputPipe pipe;
  ChildProcess process;
  const std::string failure = process.start(arguments, {.output = pipe.writeEnd(), .hasOwnGroup = true});
  if (!failure.empty()) throw Error(options_.probe, "", "cannot be run: " + failure, kInstall);
  constexpr size_t kMaxBytes = 1 << 20;
  const std::string text = pipe.readText(kMaxBytes, [&] { watch(0); });
  const std::string end = process.wait();
  const char* remedy = "name a video that plays, or a folder of photos";
  if (!end.empty()) {
    throw Error(video_.string(), "", fmt::format("is no video that {} can read: {}", options_.probe, lastLine(process)),
                remedy);
  }
  stream_ = parseVideoStream(text);
  if (!stream_) throw Error(video_.string(), "", "has no video stream", remedy);
  return *stream_;
}

void VideoFrames::choose(const Watch& watch) {
  if (stream_ && stream_->isHdr)
    warn("{}: its colours are HDR, which are not converted: the scene will look dull; export it as SDR",
         video_.string());
  if (!readChosen(listFile(), origin()).empty()) return;
  std::error_code status;
  fs::create_directories(folder_, status);
  if (status) throw Error(folder_.string(), "", "cannot be made: " + status.message(), "name another folder");
  const fs::path timesFile = folder_ / "times.partial";
  std::vector<std::string> arguments = command(options_.program);
  // Each picture goes to the pipe, and its time to a file. No frame is repeated or left out for the sake of a rate.
  arguments.insert(arguments.end(),
                   {"-filter_complex",
                    fmt::format("[0:V:0]yadif=deint=interlaced,scale='min({0},iw)':'min({0},ih)':"
                                "force_original_aspect_ratio=decrease:flags=area,format=gray,split[picture][time]",
                                kLookedAtSide),
                    "-map",
                    "[picture]",
                    "-fps_mode",
                    "passthrough",
                    "-enc_time_base",  // that of the mean rate would give some frames of phones the same time
                    "1:1000",
                    "-c:v",
                    "pgm",
                    "-f",
                    "image2pipe",
                    "pipe:1",
                    "-map",
                    "[time]",
                    "-fps_mode",
                    "passthrough",
                    "-enc_time_base",
                    "1:1000",
                    "-f",
                    "framecrc",
                    "file:" + fs::absolute(timesFile).string()});
  std::vector<double> sharpness;
  Decoding decoding(std::move(arguments), video_);
  ImageU8 picture;
  const auto look = [&] { watch(static_cast<int64_t>(sharpness.size())); };
  while (decoding.next(picture, look)) sharpness.push_back(imageSharpness(picture));
  const std::string complaint = decoding.finish();
  if (sharpness.size() < kFewestFramesOfVideo) {
    throw Error(video_.string(), "",
                fmt::format("has {} frames that can be decoded; poses need three", sharpness.size()),
                complaint.empty() ? "name a longer video, or a folder of photos" : "check that it plays: " + complaint);
  }
  if (!complaint.empty()) {
    warn("{}: {} reports: {}; frames from damaged places may be among those taken", video_.string(), options_.program,
         complaint);
  }
  const auto times = parseFrameTimes(readTextFile(timesFile));
  fs::remove(timesFile, status);
  if (!times || times->size() != sharpness.size()) {
    throw Error(video_.string(), "", fmt::format("{} does not tell the times of its frames", options_.program),
                "convert it to .mp4, and name that");
  }
  nlohmann::ordered_json frames = nlohmann::ordered_json::array();
  for (const size_t frame : chooseFrames(*times, sharpness, options_.count))
    frames.push_back({{"number", frame}, {"seconds", (*times)[frame]}, {"sharpness", sharpness[frame]}});
  writeFileAtomically(listFile(),
                      nlohmann::ordered_json{{"origin", origin()}, {"frames", std::move(frames)}}.dump(1) + "\n");
}

size_t VideoFrames::chosen() const {
  return readChosen(listFile(), origin()).size();
}

void VideoFrames::extract(const Watch& watch) {
  const std::vector<int64_t> chosen = readChosen(listFile(), origin());
  std::vector<int64_t> missing;
  std::error_code status;
  std::copy_if(chosen.begin(), chosen.end(), std::back_inserter(missing),
               [&](int64_t frame) { return !fs::exists(frameFile(frame), status); });
  size_t done = 0;
  const auto look = [&] { watch(static_cast<int64_t>(chosen.size() - missing.size() + done)); };
  while (done < missing.size()) {
    const size_t end = std::min(missing.size(), done + kFramesAtOnce);
    // The numbers count what leaves the first filter, as in `choose`.
    const std::string filters = fmt::format("yadif=deint=interlaced,select='{}',scale=iw*sar:ih,setsar=1",
                                            selectFrames(std::span(missing).subspan(done, end - done)));
    std::vector<std::string> arguments = command(options_.program);
    arguments.insert(arguments.end(),
                     {"-map", "0:V:0", "-vf", filters, "-fps_mode", "passthrough", "-frames:v",
                      std::to_string(end - done), "-pix_fmt", "rgb24", "-c:v", "ppm", "-f", "image2pipe", "pipe:1"});
    Decoding decoding(std::move(arguments), video_);
    ImageU8 picture;
    for (; done < end && decoding.next(picture, look); ++done)
      writeJpeg(frameFile(missing[done]), picture, kJpegQuality);
    const std::string complaint = decoding.finish();
    if (done == end) continue;
    throw Error(video_.string(), "",
                fmt::format("{} of {} frames could be decoded: {}", done, missing.size(), complaint),
                "run again with --from frames");
  }
}

bool VideoFrames::isComplete() const {
  const std::vector<int64_t> chosen = readChosen(listFile(), origin());
  std::error_code status;
  return !chosen.empty() &&
         std::all_of(chosen.begin(), chosen.end(), [&](int64_t frame) { return fs::exists(frameFile(frame), status); });
}

void VideoFrames::discard() const {
  std::error_code status;
  if (!fs::is_directory(folder_, status)) return;
  // The list goes first: without it, no frame counts.
  std::vector<fs::path> files{listFile()};
  for (const auto& entry : fs::directory_iterator(folder_))
    if (isFrame(entry.path().filename().string())) files.push_back(entry.path());
  for (const fs::path& file : files) {
    fs::remove(file, status);
    if (status) throw Error(file.string(), "", "cannot be removed: " + status.message(), "remove it");
  }
}

}  // namespace tessera
