#include "serve/static_site.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"

namespace tessera {
namespace {

constexpr uint64_t kLargestCompressed = uint64_t{16} << 20, kSmallestCompressed = 1024;

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

Kind fileKind(const fs::path& file) {
  const std::string extension = file.extension().string();
  const auto match =
      std::find_if(std::begin(kKinds), std::end(kKinds), [&](const Kind& kind) { return extension == kind.extension; });
  return match == std::end(kKinds) ? Kind{"", "application/octet-stream", false} : *match;
}

// Recognises "name-0123456789abcdef.glb", and "name-aB3_x9Zq.js" in the folder `assets` of the viewer's own files.
bool holdsDigest(const fs::path& file, bool isOfViewer) {
  const std::string stem = file.stem().string();
  const size_t dash = stem.rfind('-');
  if (dash == std::string::npos) return false;
  const std::string digest = stem.substr(dash + 1);
  if (file.extension() == ".glb" || file.parent_path().filename() == "resources") {
    return digest.size() == 16 && digest.find_first_not_of("0123456789abcdef") == std::string::npos;
  }
  return isOfViewer && digest.size() == 8 && file.parent_path().filename() == "assets";
}

std::string sitePrefix(const SiteFolder& folder) {
  return folder.name.empty() ? "/" : "/" + folder.name + "/";
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

StaticSite::StaticSite(std::vector<SiteFolder> folders, std::vector<std::string> hosts, std::string start)
    : folders_(std::move(folders)), hosts_(std::move(hosts)), start_(std::move(start)) {
  std::error_code status;
  if (!fs::is_directory("/proc/self/fd", status)) {
    throw Error("/proc", "", "is not mounted, but is needed to identify opened files", "mount it");
  }
  for (SiteFolder& one : folders_) {
    const fs::path canonical = fs::canonical(one.folder, status);
    if (status || !fs::is_directory(canonical)) {
      throw Error(one.folder.string(), "", "is not a folder", "name one that exists");
    }
    one.folder = canonical;
  }
  // The longest name first, so that "" comes last.
  std::sort(folders_.begin(), folders_.end(),
            [](const SiteFolder& a, const SiteFolder& b) { return a.name.size() > b.name.size(); });
}

const SiteFolder* StaticSite::findFolder(const std::string& path) const {
  const auto one = std::find_if(folders_.begin(), folders_.end(),
                                [&](const SiteFolder& folder) { return path.starts_with(sitePrefix(folder)); });
  return one == folders_.end() ? nullptr : &*one;
}

SiteAnswer StaticSite::answer(const SiteRequest& request) const {
  SiteAnswer answer;
  const auto finish = [&](SiteAnswer done) {
    done.sendsBody = request.method != "HEAD";
    done.headers.emplace_back("X-Content-Type-Options", "nosniff");
    return done;
  };
  if (!hosts_.empty()) {
    const auto host = parseHost(request.host);
    if (!host || std::find(hosts_.begin(), hosts_.end(), *host) == hosts_.end()) {
      return finish(plain(421, "this server does not serve that host"));
    }
  }
  if (request.method != "GET" && request.method != "HEAD") {
    SiteAnswer refused = plain(405, "only GET and HEAD are supported");
    refused.headers.emplace_back("Allow", "GET, HEAD");
    return finish(std::move(refused));
  }
  if (!start_.empty() && request.target == "/") {
    SiteAnswer onward = plain(302, "continue at " + start_);
    onward.headers.emplace_back("Location", start_);
    return finish(std::move(onward));
  }
  const auto path = pathOfTarget(request.target);
  const SiteFolder* folder = path ? findFolder(*path) : nullptr;
  SiteFile::Opening opening;
  if (folder != nullptr) {
    // The path has already been checked by pathOfTarget; links may still lead outside.
    const std::string rest = path->substr(sitePrefix(*folder).size());
    opening = SiteFile::open(folder->folder, rest.empty() && folder->name.empty() ? "index.html" : rest);
  }
  if (opening.isBusy) return finish(plain(503, "too many files are open"));
  const auto& file = opening.file;
  if (!file) return finish(plain(404, "there is no such file"));
  const uint64_t bytes = file->bytes();
  const Kind kind = fileKind(file->path());
  std::string tag = file->tag();
  answer.headers = {
      {"Content-Type", kind.type},
      {"Cache-Control",
       holdsDigest(file->path(), folder->name.empty()) ? "public, max-age=31536000, immutable" : "no-cache"},
      {"Accept-Ranges", "bytes"}};
  const bool compressible = kind.isText && bytes >= kSmallestCompressed && bytes <= kLargestCompressed;
  if (compressible) answer.headers.emplace_back("Vary", "Accept-Encoding");
  const bool asksForPart = !request.range.empty() && (request.ifRange.empty() || request.ifRange == tag);
  answer.isGzipped = compressible && !asksForPart && acceptsGzip(request.acceptEncoding);
  if (answer.isGzipped) {
    tag.insert(tag.size() - 1, "-gzip");
    answer.headers.emplace_back("Content-Encoding", "gzip");
  }
  answer.headers.emplace_back("ETag", tag);
  if (!request.ifNoneMatch.empty() && matchesTag(request.ifNoneMatch, tag)) {
    answer.status = 304;
    answer.isGzipped = false;
    return finish(std::move(answer));
  }
  answer.file = file;
  answer.bytes = {0, bytes};
  if (answer.isGzipped) return finish(std::move(answer));
  const RangeRequest range = asksForPart ? parseRange(request.range, bytes) : RangeRequest{};
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
