// The style sheet of reports.
#pragma once

namespace tessera {

inline constexpr char kReportStyle[] = R"css(
:root { color-scheme: light dark; --text: #1d2329; --quiet: #5f6b76; --page: #f6f7f9; --card: #fff; --line: #dfe3e8;
  --accent: #2763c4; }
@media (prefers-color-scheme: dark) {
  :root { --text: #e6e9ed; --quiet: #98a3ae; --page: #14171a; --card: #1e2226; --line: #333a41; --accent: #7fb0ff; }
}
* { box-sizing: border-box; }
body { margin: 0; background: var(--page); color: var(--text); font: 15px/1.5 system-ui, -apple-system, "Segoe UI",
  Roboto, "Helvetica Neue", Arial, sans-serif; font-variant-numeric: tabular-nums; }
main { max-width: 1600px; margin: 0 auto; padding: 2rem 1.5rem 4rem; }
h1 { font-size: 1.7rem; margin: 0 0 .2rem; overflow-wrap: anywhere; }
h2 { font-size: 1.15rem; margin: 2.2rem 0 .7rem; }
h3 { font-size: 1rem; margin: 0; overflow-wrap: anywhere; }
p { margin: .3rem 0; }
a { color: var(--accent); text-decoration: none; }
a:hover { text-decoration: underline; }
.quiet { color: var(--quiet); }
.cards { display: flex; flex-wrap: wrap; gap: .8rem; margin-top: 1.2rem; }
.card { background: var(--card); border: 1px solid var(--line); border-radius: 10px; padding: .7rem 1.1rem;
  min-width: 9rem; }
.card b { display: block; font-size: 1.6rem; font-weight: 650; line-height: 1.3; }
.bars { background: var(--card); border: 1px solid var(--line); border-radius: 10px; padding: 1rem; overflow-x: auto; }
.bars svg { display: block; width: 100%; height: 130px; }
.bars rect { fill: var(--accent); opacity: .8; }
.bars a:hover rect { opacity: 1; }
.scroll { overflow-x: auto; background: var(--card); border: 1px solid var(--line); border-radius: 10px; }
.table { max-height: 26rem; overflow: auto; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: right; padding: .35rem .9rem; border-bottom: 1px solid var(--line); white-space: nowrap; }
th { position: sticky; top: 0; background: var(--card); color: var(--quiet); font-weight: 600; }
th:first-child, td:first-child { text-align: left; white-space: normal; overflow-wrap: anywhere; }
tr:last-child td { border-bottom: 0; }
.view { background: var(--card); border: 1px solid var(--line); border-radius: 10px; padding: 1rem; margin: 0 0 1rem;
  scroll-margin-top: 1rem; }
.view:target { border-color: var(--accent); }
.view header { display: flex; flex-wrap: wrap; gap: .2rem 1.2rem; align-items: baseline; margin-bottom: .7rem; }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(230px, 100%), 1fr)); gap: .7rem; }
figure { margin: 0; }
figure label { display: block; cursor: zoom-in; }
figure input { position: absolute; opacity: 0; pointer-events: none; }
figure img { display: block; width: 100%; height: auto; border-radius: 6px; background: #0004; }
figure input:focus-visible + img { outline: 2px solid var(--accent); }
figure input:checked + img { position: fixed; inset: 0; width: 100vw; height: 100vh; object-fit: contain;
  background: #000e; border-radius: 0; z-index: 9; cursor: zoom-out; }
figcaption { color: var(--quiet); font-size: .85rem; padding-top: .25rem; }
@media print { .table { max-height: none; } .view { break-inside: avoid; } }
)css";

}  // namespace tessera
