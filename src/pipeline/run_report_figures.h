// The figures of a georeference in the report of a run, as SVG for the inside of an HTML page. Their colours are those
// of the page's style (eval/report_style.h) and of kFigureStyle. One mark stands for each photo, with its name and its
// residual as a tooltip; marks of outliers have the class "outlier".
#pragma once

#include <string>
#include <vector>

#include "pipeline/georeference_json.h"

namespace tessera {

extern const char kFigureStyle[];  // CSS

struct SvgFigure {
  std::string svg;
  std::string caption;  // HTML
};

// Horizontal and vertical residuals as bars, flight by flight in order of the photos' names, with what their standard
// deviations predict. There must be residuals.
SvgFigure residualFigure(const std::vector<GeoreferenceFile::Residual>& residuals);

// The positions of the cameras from above, with their horizontal residuals as arrows, exaggerated by a factor that the
// caption states. There must be residuals.
SvgFigure planFigure(const std::vector<GeoreferenceFile::Residual>& residuals);

}  // namespace tessera
