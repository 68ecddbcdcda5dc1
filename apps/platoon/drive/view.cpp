// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/view.hpp"

#include <boost/describe/enum_to_string.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace platoon {
namespace {

struct row {
    std::string name;
    std::string mode;
    motion where;
    double distance = NAN; ///< to the one ahead
};

std::vector<row> rows_of(const logbook& book, const std::vector<std::string>& vehicles, double t, double silent_after) {
    std::vector<row> rows;
    for (const auto& name : vehicles) {
        const auto* last = book.last(name);
        const auto where = book.position(name, t);
        if (last == nullptr || !where) {
            continue;
        }
        const bool silent = book.has_ended(name) || t - last->t > silent_after;
        rows.push_back({name, silent ? "SILENT" : boost::describe::enum_to_string(last->mode, ""), *where});
        if (rows.back().mode == "fallback") {
            rows.back().mode = "FALLBACK";
        }
    }
    std::sort(rows.begin(), rows.end(), [](const row& a, const row& b) { return a.where.x > b.where.x; });
    for (std::size_t i = 1; i < rows.size(); ++i) {
        rows[i].distance = rows[i - 1].where.x - rows[i].where.x;
    }
    return rows;
}

std::string bar(double error) {
    constexpr double step = 0.05; // m of error for each character
    const auto length =
        std::isfinite(error) ? std::clamp(static_cast<int>(std::lround(std::abs(error) / step)), 0, 30) : 0;
    return std::string(static_cast<std::size_t>(length), error < 0 ? '<' : '>');
}

} // namespace

std::string table_of(const logbook& book, const std::vector<std::string>& vehicles, double t, double spacing,
                     double silent_after) {
    std::array<char, 160> line{};
    std::snprintf(line.data(), line.size(), "%7.1f s   m/s   m/s2  distance   error\n", t);
    std::string text = line.data();
    for (const auto& row : rows_of(book, vehicles, t, silent_after)) {
        if (std::isfinite(row.distance)) {
            const double error = row.distance - spacing;
            std::snprintf(line.data(), line.size(), "%-6s %6.2f %6.2f  %8.2f  %+6.2f  %-9s%s\n", row.name.c_str(),
                          row.where.v, row.where.a, row.distance, error, row.mode.c_str(), bar(error).c_str());
        } else {
            std::snprintf(line.data(), line.size(), "%-6s %6.2f %6.2f                    %s\n", row.name.c_str(),
                          row.where.v, row.where.a, row.mode.c_str());
        }
        text += line.data();
    }
    return text;
}

std::string line_of(const logbook& book, const std::vector<std::string>& vehicles, double t, double spacing,
                    double silent_after) {
    const auto rows = rows_of(book, vehicles, t, silent_after);
    if (rows.empty()) {
        return "no vehicle is received\n";
    }
    double error = 0;
    double least = INFINITY;
    std::map<std::string, std::string> unusual;
    for (const auto& row : rows) {
        if (std::isfinite(row.distance)) {
            error = std::max(error, std::abs(row.distance - spacing));
            least = std::min(least, row.distance);
        }
        if (row.mode != "follow" && row.mode != "lead") {
            unusual[row.mode] += " " + row.name;
        }
    }
    std::array<char, 160> line{};
    std::snprintf(line.data(), line.size(),
                  "%6.1f s  %zu vehicles, %.2f to %.2f m/s, %.3f m off at most, %.2f m apart at least", t, rows.size(),
                  rows.front().where.v, rows.back().where.v, error, least);
    std::string text = line.data();
    for (const auto& [mode, names] : unusual) {
        text.append("; ").append(mode).append(":").append(names);
    }
    return text + "\n";
}

std::string line_of(const event& what) {
    std::array<char, 32> time{};
    std::snprintf(time.data(), time.size(), "%6.1f s  ", what.t);
    return time.data() + what.vehicle + "  " + what.mode + (what.why.empty() ? "" : ": " + what.why) + "\n";
}

} // namespace platoon
