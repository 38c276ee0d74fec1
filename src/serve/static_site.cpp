#include "serve/static_site.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <zlib.h>

#include <algorithm>

#include "base/error.h"

namespace tessera {
namespace {

constexpr uint64_t kLargestCompressed = uint64_t{16} << 20, kSmallestCompressed = 1024;
constexpr size_t kMostCompressed = 64;  // files in memory

struct Kind {
  const char* extension;
  const char* type;
  bool isText;  // worth compressing
};

constexpr Kind kKinds[] = {{".html", "text/html; charset=utf-8", true},
                           {".js", "text/javascript; charset=utf-8", true},
                           {".css", "text/css; charset=utf-8", true},
                           {".json", "application/json", true},
                           {".geojson", "application/geo+json", true},
                           {".webmanifest", "application/manifest+json", true},
                           {".svg", "image/svg+xml", true},
                           {".txt", "text/plain; charset=utf-8", true},
                           {".wasm", "application/wasm", true},
                           {".glb", "model/gltf-binary", false},
                           {".gltf", "model/gltf+json", true},
                           {".png", "image/png", false},
                           {".jpg", "image/jpeg", false},
                           {".jpeg", "image/jpeg", false},
                           {".webp", "image/webp", false},
                           {".ico", "image/x-icon", false},
                           {".woff2", "font/woff2", false}};

Kind kindOf(const fs::path& file) {
  const std::string extension = file.extension().string();
  const auto found =
      std::find_if(std::begin(kKinds), std::end(kKinds), [&](const Kind& kind) { return extension == kind.extension; });
  return found == std::end(kKinds) ? Kind{"", "application/octet-stream", false} : *found;
}

// "name-0123456789abcdef.glb", and "name-aB3_x9Zq.js" of the viewer's own files.
bool holdsDigest(const fs::path& file) {
  const std::string stem = file.stem().string();
  const size_t dash = stem.rfind('-');
  if (dash == std::string::npos) return false;
  const std::string digest = stem.substr(dash + 1);
  if (file.extension() == ".glb" || file.parent_path().filename() == "resources") {
    return digest.size() == 16 && digest.find_first_not_of("0123456789abcdef") == std::string::npos;
  }
  return digest.size() == 8 && file.parent_path().filename() == "assets";
}

// Without a part that begins with a dot on the way.
bool isBelow(const fs::path& file, const fs::path& folder) {
  const auto [end, inFile] = std::mismatch(folder.begin(), folder.end(), file.begin(), file.end());
  return end == folder.end() && inFile != file.end() &&
         std::none_of(inFile, file.end(), [](const fs::path& part) { return part.string().starts_with('.'); });
}

SiteAnswer plain(int status, const std::string& reason) {
  SiteAnswer answer;
  answer.status = status;
  answer.headers = {{"Content-Type", "text/plain; charset=utf-8"}, {"Cache-Control", "no-store"}};
  answer.body = reason + "\n";
  answer.length = answer.body.size();
  return answer;
}

}  // namespace

StaticSite::StaticSite(std::vector<SiteFolder> folders, std::vector<std::string> hosts)
    : folders_(std::move(folders)), hosts_(std::move(hosts)) {
  for (SiteFolder& one : folders_) {
    std::error_code status;
    const fs::path canonical = fs::canonical(one.folder, status);
    if (status || !fs::is_directory(canonical)) {
      throw Error(one.folder.string(), "", "is no folder", "name one that is there");
    }
    one.folder = canonical;
  }
  // The longest name first, so that "" comes last.
  std::sort(folders_.begin(), folders_.end(),
            [](const SiteFolder& a, const SiteFolder& b) { return a.name.size() > b.name.size(); });
}

// The path has been looked at already (pathOfTarget); links may still lead out.
std::optional<fs::path> StaticSite::fileAt(const std::string& path) const {
  for (const SiteFolder& one : folders_) {
    const std::string prefix = one.name.empty() ? "/" : "/" + one.name + "/";
    if (!path.starts_with(prefix)) continue;
    std::string rest = path.substr(prefix.size());
    if (rest.empty() && one.name.empty()) rest = "index.html";
    std::error_code status;
    const fs::path file = fs::canonical(one.folder / rest, status);
    if (status || !isBelow(file, one.folder) || !fs::is_regular_file(file, status)) return std::nullopt;
    return file;
  }
  return std::nullopt;
}

std::shared_ptr<const std::string> StaticSite::compressedOf(const fs::path& file, const std::string& tag) const {
  {
    const std::lock_guard lock(mutex_);
    if (const auto found = compressed_.find(file); found != compressed_.end() && found->second.tag == tag) {
      return found->second.bytes;
    }
  }
  std::shared_ptr<std::string> bytes = std::make_shared<std::string>();
  try {
    const Bytes read = readFile(file, kLargestCompressed);
    z_stream stream{};
    if (deflateInit2(&stream, 6, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY) != Z_OK) return nullptr;  // + 16: gzip
    bytes->resize(deflateBound(&stream, read.size()));
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(read.data()));
    stream.avail_in = static_cast<uInt>(read.size());
    stream.next_out = reinterpret_cast<Bytef*>(bytes->data());
    stream.avail_out = static_cast<uInt>(bytes->size());
    const bool done = deflate(&stream, Z_FINISH) == Z_STREAM_END;
    bytes->resize(stream.total_out);
    deflateEnd(&stream);
    if (!done) return nullptr;
  } catch (const Error&) {
    return nullptr;
  }
  const std::lock_guard lock(mutex_);
  if (compressed_.size() >= kMostCompressed) compressed_.clear();
  compressed_[file] = {tag, bytes};
  return bytes;
}

SiteAnswer StaticSite::answer(const SiteRequest& request) const {
  SiteAnswer answer;
  const auto finish = [&](SiteAnswer done) {
    done.sendsBody = request.method != "HEAD";
    done.headers.emplace_back("X-Content-Type-Options", "nosniff");
    return done;
  };
  if (!hosts_.empty()) {
    const auto host = hostOf(request.host);
    if (!host || std::find(hosts_.begin(), hosts_.end(), *host) == hosts_.end()) {
      return finish(plain(421, "this server is not called that"));
    }
  }
  if (request.method != "GET" && request.method != "HEAD") {
    SiteAnswer refused = plain(405, "files can be read, and nothing else");
    refused.headers.emplace_back("Allow", "GET, HEAD");
    return finish(std::move(refused));
  }
  const auto path = pathOfTarget(request.target);
  const auto file = path ? fileAt(*path) : std::nullopt;
  struct stat status;
  if (!file || ::stat(file->c_str(), &status) != 0) return finish(plain(404, "there is no such file"));
  const auto bytes = static_cast<uint64_t>(status.st_size);
  const Kind kind = kindOf(*file);
  std::string tag = fmt::format("\"{:x}-{:x}.{:x}\"", bytes, status.st_mtim.tv_sec, status.st_mtim.tv_nsec);
  answer.headers = {{"Content-Type", kind.type},
                    {"Cache-Control", holdsDigest(*file) ? "public, max-age=31536000, immutable" : "no-cache"},
                    {"Accept-Ranges", "bytes"}};
  const bool compressible = kind.isText && bytes >= kSmallestCompressed && bytes <= kLargestCompressed;
  if (compressible) answer.headers.emplace_back("Vary", "Accept-Encoding");
  const bool asksForPart = !request.range.empty() && (request.ifRange.empty() || request.ifRange == tag);
  if (compressible && !asksForPart && acceptsGzip(request.acceptEncoding)) {
    answer.compressed = compressedOf(*file, tag);
    if (answer.compressed) {
      tag.insert(tag.size() - 1, "-gzip");
      answer.headers.emplace_back("Content-Encoding", "gzip");
    }
  }
  answer.headers.emplace_back("ETag", tag);
  if (!request.ifNoneMatch.empty() && matchesTag(request.ifNoneMatch, tag)) {
    answer.status = 304;
    answer.compressed = nullptr;
    return finish(std::move(answer));
  }
  if (answer.compressed) {
    answer.length = answer.compressed->size();
    return finish(std::move(answer));
  }
  answer.file = *file;
  answer.bytes = {0, bytes};
  const RangeRequest range = asksForPart ? rangeOf(request.range, bytes) : RangeRequest{};
  if (range.kind == RangeRequest::none) {
    SiteAnswer outside = plain(416, "the file has no such bytes");
    outside.headers.emplace_back("Content-Range", fmt::format("bytes */{}", bytes));
    return finish(std::move(outside));
  }
  if (range.kind == RangeRequest::part) {
    answer.status = 206;
    answer.bytes = range.range;
    answer.headers.emplace_back("Content-Range",
                                fmt::format("bytes {}-{}/{}", range.range.begin, range.range.end - 1, bytes));
  }
  answer.length = answer.bytes.end - answer.bytes.begin;
  return finish(std::move(answer));
}

}  // namespace tessera
