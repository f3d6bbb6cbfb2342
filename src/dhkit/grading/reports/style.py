"""The style of the pages: light and dark, wide and narrow, screen and paper."""

from __future__ import annotations

STYLE = """
:root { color-scheme: light dark; --ink: #1b1f24; --paper: #fff; --faint: #57606a; --line: #d8dee4;
        --right: #116329; --wrong: #b3261e; --open: #7a5200; --unread: #6e40a9; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e9ed; --paper: #14171a; --faint: #9aa4af; --line: #3a4149;
          --right: #6cc47e; --wrong: #ff8f86; --open: #e0b050; --unread: #c4a2f5; } }
* { box-sizing: border-box; }
body { font: 16px/1.5 "Source Sans 3", "Noto Sans", "DejaVu Sans", sans-serif; color: var(--ink);
       background: var(--paper); max-width: 60rem; margin: 2rem auto; padding: 0 1rem; overflow-wrap: anywhere; }
h1 { font-size: 1.6rem; line-height: 1.2; } h2 { font-size: 1.25rem; margin-top: 2.5rem; }
h3 { font-size: 1.05rem; margin: 0 0 .3rem; } h3 .note { font-weight: normal; }
a { color: inherit; } p { margin: .35rem 0; } .note, th { color: var(--faint); } .sum { font-size: 1.1rem; }
.error, .found { border-left: 3px solid var(--wrong); padding-left: .7rem; }
.badge { white-space: nowrap; font-weight: 600; }
.right { color: var(--right); } .wrong { color: var(--wrong); } .open { color: var(--open); }
.unread { color: var(--unread); }
.wide { overflow: auto hidden; padding: .2rem 0; } math { font-size: 1.08rem; }
math[display="block"] { width: fit-content; margin: 0 0 0 1rem; }
code { font: .92em/1.4 "Source Code Pro", "DejaVu Sans Mono", monospace; }
article { border-top: 1px solid var(--line); padding: .7rem 0; break-inside: avoid; }
details { margin-top: 1rem; } summary { cursor: pointer; }
table { border-collapse: collapse; margin: .6rem 0; }
th, td { text-align: left; padding: .25rem 1rem .25rem 0; border-bottom: 1px solid var(--line); }
td:first-child { white-space: nowrap; }
th { font-weight: normal; } td.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
td.bar { width: 50%; min-width: 8rem; } td.bar i { display: block; height: .8rem; background: var(--wrong); }
@media print { body { max-width: none; margin: 0; font-size: 11pt; } section { break-before: page; }
  td.bar i { print-color-adjust: exact; -webkit-print-color-adjust: exact; } }
"""
