// report.html: an evaluation as one self-contained file that works offline and without scripts. It has a summary, a
// table with the worst views first, and for each view the photo, the render, the error and the depth side by side.
#pragma once

#include <map>
#include <string>

#include "eval/evaluate.h"

namespace tessera {

// Collects downscaled images while `evaluate` runs, so that the full-size images of a view can be released:
//   ReportBuilder builder("fox", capture.photosIn(split).size());
//   options.onView = [&](const ViewResult& result, const ViewPictures& pictures) { builder.add(result, pictures); };
//   builder.write("report.html", evaluate(renderer, capture, options));
class ReportBuilder {
 public:
  // `title`: the name of what was evaluated. `expectedViews` determines the size of the images: the more views, the
  // smaller, so that the file stays within some tens of megabytes.
  ReportBuilder(std::string title, size_t expectedViews);

  void add(const ViewResult& result, const ViewPictures& pictures);
  // Returns the report. Views that were not added have numbers but no images.
  std::string html(const EvaluationReport& report) const;
  void write(const fs::path& path, const EvaluationReport& report) const;  // throws Error if it cannot be written

 private:
  struct Figure {
    std::string caption;
    Bytes jpeg;
    int width = 0, height = 0;
  };

  Figure figure(std::string caption, const ImageU8& image, int orientation) const;

  std::string title_;
  int longestSide_;
  std::map<std::string, std::vector<Figure>> figures_;  // by view name
};

}  // namespace tessera
