// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/recording.hpp"

#include <cles/convert.hpp>
#include <cles/error.hpp>

#include "platoon/driver/localization.hpp"
#include "platoon/simulation/outcome.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <utility>

namespace platoon {
namespace {

constexpr double budget_us = 100'000;

[[noreturn]] void throw_cannot_write(const std::string& path, int why) {
    const boost::system::error_code code{why, boost::system::system_category()};
    throw cles::error(code, "cannot write " + path + ": " + code.message());
}

// The vehicle at that place when all were first on the lane; without courses, they are numbered from the front.
std::string one_ahead(const recording& drive, std::ptrdiff_t place) {
    std::vector<std::pair<double, std::string>> order;
    for (const auto& each : drive.courses) {
        const auto first = std::find_if(each.place.begin(), each.place.end(), [](double x) { return !std::isnan(x); });
        if (first != each.place.end()) {
            order.emplace_back(-*first, each.vehicle);
        }
    }
    std::sort(order.begin(), order.end());
    const auto index = static_cast<std::size_t>(place);
    return index < order.size() ? order[index].second : "v" + std::to_string(index);
}

} // namespace

void extend(course& of, const motion& where, double distance, double spacing, const std::string& mode) {
    const auto place = std::isnan(where.x) ? geo::geographic{.lat = NAN, .lon = NAN} : place_on_road(where.x);
    of.speed.push_back(where.v);
    of.acceleration.push_back(where.a);
    of.error.push_back(distance - spacing);
    of.distance.push_back(distance);
    of.place.push_back(where.x);
    of.lat.push_back(place.lat);
    of.lon.push_back(place.lon);
    of.mode.push_back(mode);
}

latency_summary summarise(std::vector<double> latencies_us) {
    latency_summary out{.count = latencies_us.size()};
    if (latencies_us.empty()) {
        return out;
    }
    std::sort(latencies_us.begin(), latencies_us.end());
    const auto at = [&](double part) {
        return latencies_us[static_cast<std::size_t>(std::lround(part * static_cast<double>(latencies_us.size() - 1)))];
    };
    out.p50_us = at(0.5);
    out.p99_us = at(0.99);
    out.p999_us = at(0.999);
    out.max_us = latencies_us.back();
    out.late = static_cast<std::uint64_t>(latencies_us.end() -
                                          std::upper_bound(latencies_us.begin(), latencies_us.end(), budget_us));
    for (int i = 0; i <= 1000; ++i) {
        out.curve.push_back(at(i * 0.001));
    }
    return out;
}

std::string summary_of(const recording& drive) {
    const auto& v = drive.verdict;
    std::string text;
    std::array<char, 256> line{};
    const auto add = [&](int length) {
        text.append(line.data(), std::min(line.size() - 1, static_cast<std::size_t>(length)));
    };
    if (drive.hz > 0) {
        add(std::snprintf(line.data(), line.size(), "platoon   %zu vehicles at %g Hz, %g %% lost, up to %g ms late\n",
                          drive.vehicles, drive.hz, drive.loss * 100, drive.delay_ms));
    } else {
        add(std::snprintf(line.data(), line.size(), "platoon   %zu vehicles, watched for %.1f s\n", drive.vehicles,
                          drive.t.empty() ? 0 : drive.t.back()));
    }
    if (drive.burst > 0) {
        add(std::snprintf(line.data(), line.size(), "losses    in bursts of %g updates on average\n", drive.burst));
    }
    if (drive.steady && !std::isnan(v.least_gap) && !v.error.empty()) {
        const auto most = std::max_element(v.error.begin(), v.error.end());
        add(std::snprintf(line.data(), line.size(), "spacing   %.3f m off at most, behind %s; string ratio %.4f\n",
                          *most, one_ahead(drive, most - v.error.begin()).c_str(), v.string_ratio));
        if (!std::isnan(v.first_ratio)) {
            add(std::snprintf(line.data(), line.size(),
                              "first     errors of up to %.4f times the one behind the leader\n", v.first_ratio));
        }
        if (!std::isnan(v.acceleration_ratio)) {
            add(std::snprintf(line.data(), line.size(),
                              "hardest   accelerations of up to %.4f times those of the leader\n",
                              v.acceleration_ratio));
        }
        text += gains_line("braking  ", v.braking);
        text += gains_line("recovery ", v.recovery);
        text += gains_line("sine     ", v.sine);
    }
    if (drive.steady && !v.ended) {
        text += "ended     no: the drive was over before the manoeuvre, so it does not show string stability\n";
    }
    if (drive.steady && v.stands) {
        text += "stands    A VEHICLE STANDS at the end\n";
    }
    if (drive.steady && v.apart) {
        text += "apart     THE PLATOON FELL APART: a vehicle is more than 50 m behind its place at the end\n";
    }
    if (std::isnan(v.least_gap)) {
        text += "gap       unknown: the drive ended before all vehicles had started\n";
    } else {
        add(std::snprintf(line.data(), line.size(), "gap       %.3f m at least%s\n", v.least_gap,
                          v.collision ? ": A COLLISION" : ""));
    }
    if (drive.hz == 0) {
        return text;
    }
    add(std::snprintf(line.data(), line.size(), "radar     %ju times alone because updates were missing\n",
                      std::uintmax_t{drive.radar_spells}));
    add(std::snprintf(line.data(), line.size(), "fallback  %ju times because updates were missing\n",
                      std::uintmax_t{drive.fallbacks}));
    if (drive.relayed + drive.lost != 0) {
        add(std::snprintf(line.data(), line.size(), "relay     %ju of %ju packets lost\n", std::uintmax_t{drive.lost},
                          std::uintmax_t{drive.relayed + drive.lost}));
        if (drive.overflown != 0) {
            add(std::snprintf(line.data(), line.size(),
                              "          %ju more could not be delivered: the losses differ\n",
                              std::uintmax_t{drive.overflown}));
        }
        add(std::snprintf(line.data(), line.size(),
                          "gaps      %ju updates missing of %ju, as the nodes of the vehicles reported\n",
                          std::uintmax_t{drive.missed}, std::uintmax_t{drive.received + drive.missed}));
    }
    if (drive.latency.count != 0) {
        const auto& l = drive.latency;
        add(std::snprintf(line.data(), line.size(),
                          "latency   p50 %.3f ms, p99 %.3f, p99.9 %.3f, max %.3f of %ju updates; %ju over 100 ms\n",
                          l.p50_us / 1e3, l.p99_us / 1e3, l.p999_us / 1e3, l.max_us / 1e3, std::uintmax_t{l.count},
                          std::uintmax_t{l.late}));
    }
    return text;
}

void check_writable(const std::string& path) {
    auto* file = std::fopen(path.c_str(), "ae");
    if (file == nullptr) {
        throw_cannot_write(path, errno);
    }
    std::fclose(file);
}

void write(const recording& drive, const std::string& path) {
    const auto text = cles::to_json(drive) + "\n";
    auto* file = std::fopen(path.c_str(), "we");
    if (file == nullptr) {
        throw_cannot_write(path, errno);
    }
    int why = std::fwrite(text.data(), 1, text.size(), file) == text.size() ? 0 : errno;
    if (std::fclose(file) != 0 && why == 0) {
        why = errno;
    }
    if (why != 0) {
        throw_cannot_write(path, why);
    }
}

} // namespace platoon
