// SPDX-License-Identifier: BSL-1.0
#include "config/config_file.hpp"

#include <cles/json_writer.hpp>
#include <cles/limit_ranges.hpp>

#include "config/config.hpp"
#include "config/config_values.hpp"
#include "config/yaml_value.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <fstream>
#include <sstream>
#include <string_view>
#include <system_error>
#include <vector>

namespace cles::runtime {
namespace {

constexpr std::size_t max_file_size = 1U << 20U;

// A list of strings, each converted by `to`; a single one may be written without brackets.
template <class F>
std::vector<std::string> string_list(const yaml_value& from, F to) {
    if (from.is_scalar()) {
        return {from.as(to)};
    }
    std::vector<std::string> all;
    from.read_list([&](const yaml_value& item) { all.push_back(item.as(to)); });
    return all;
}

template <class T>
yaml_value::reader count_into(T& to, std::uint64_t min, std::uint64_t max) {
    return [&to, min, max](const yaml_value& v) {
        to = static_cast<T>(v.as([&](const std::string& text) { return to_count(text, min, max); }));
    };
}

yaml_value::reader bool_into(bool& to) {
    return [&to](const yaml_value& v) { to = v.as(to_bool); };
}

yaml_value::reader duration_into(std::chrono::microseconds& to) {
    return [&to](const yaml_value& v) { to = v.as(to_duration); };
}

// One string with commas, or a list.
std::string interfaces_of(const yaml_value& from) {
    if (from.is_scalar()) {
        return from.as(to_interfaces);
    }
    std::string all;
    from.read_list([&](const yaml_value& item) { all += (all.empty() ? "" : ",") + item.as(to_interfaces); });
    try {
        return to_interfaces(all);
    } catch (const invalid_value& e) {
        from.fail(e.what());
    }
}

multicast_options multicast_of(const yaml_value& from) {
    if (from.is_scalar()) {
        return from.as(to_multicast);
    }
    multicast_options read{.interface = "lo"};
    if (from.is_list()) {
        read.interface = interfaces_of(from);
        return read;
    }
    from.read_map({{"interface", [&](const yaml_value& v) { read.interface = interfaces_of(v); }},
                   {"group",
                    [&](const yaml_value& v) {
                        read.group =
                            v.as([](const std::string& group) { return to_multicast("lo," + group + ":1").group; });
                    }},
                   {"port", count_into(read.port, 1, 65535)},
                   {"required", bool_into(read.required)}});
    return read;
}

void read_log(const yaml_value& from, log_config& into) {
    if (from.is_scalar()) {
        into = from.as([&](const std::string& text) { return to_log_config(text, into); });
        return;
    }
    from.read_map({{"level", [&](const yaml_value& v) { into.level = v.as(to_log_level); }},
                   {"format", [&](const yaml_value& v) { into.format = v.as(to_log_format); }}});
}

plugin_config plugin_of(const yaml_value& from) {
    const auto to_path = [](const std::string& path) {
        if (path.empty()) {
            throw invalid_value("is empty");
        }
        return path;
    };
    plugin_config read;
    if (from.is_scalar()) {
        read.path = from.as(to_path);
        return read;
    }
    from.read_map({{"path", [&](const yaml_value& v) { read.path = v.as(to_path); }},
                   {"config", [&](const yaml_value& v) { read.config = v.json(); }},
                   {"required", bool_into(read.required)}});
    if (read.path.empty()) {
        from.fail("has no 'path'");
    }
    return read;
}

constexpr std::size_t max_links = 20'000; // each takes a file descriptor

std::size_t max_of(const count_range& range) {
    return range.member == &limits::links || range.member == &limits::links_per_address ? max_links : range.most;
}

std::chrono::milliseconds to_milliseconds(const std::string& text, const time_range& range) {
    // Rounded up, because 0 turns some limits off.
    const auto span = std::chrono::ceil<std::chrono::milliseconds>(to_duration(text));
    const auto bound = [](std::chrono::milliseconds at) { return to_string(std::chrono::microseconds{at}); };
    if (span < range.least) {
        throw invalid_value("'" + text + "' is too short: " + bound(range.least) + " at least");
    }
    if (span > range.most) {
        throw invalid_value("'" + text + "' is too long: " + bound(range.most) + " at most");
    }
    return span;
}

void read_limits(const yaml_value& from, limits& into) {
    yaml_value::readers known;
    for (const auto& range : count_ranges) {
        known.emplace(range.name, [&into, &range](const yaml_value& v) {
            into.*range.member = v.as([&](const std::string& text) {
                return static_cast<std::size_t>(to_size(text, range.least, max_of(range)));
            });
        });
    }
    for (const auto& range : time_ranges) {
        known.emplace(range.name, [&into, &range](const yaml_value& v) {
            into.*range.member = v.as([&](const std::string& text) { return to_milliseconds(text, range); });
        });
    }
    from.read_map(known);
}

void read_all(const yaml_value& from, config& into) {
    constexpr std::uint64_t max_workers = 1024;
    constexpr std::uint64_t max_queue = 1'000'000;
    from.read_map(
        {{"node", [&](const yaml_value& v) { into.node = v.as(to_node_name); }},
         {"pool", [&](const yaml_value& v) { into.pool = v.as(to_pool_name); }},
         {"allow_clash", bool_into(into.allow_clash)},
         {"listen", [&](const yaml_value& v) { into.listen = string_list(v, to_url); }},
         {"insecure", bool_into(into.insecure)},
         {"networks", [&](const yaml_value& v) { into.networks = string_list(v, to_network); }},
         {"multicast", [&](const yaml_value& v) { into.multicast = multicast_of(v); }},
         {"seeds", [&](const yaml_value& v) { into.seeds = string_list(v, to_url); }},
         {"peers",
          [&](const yaml_value& v) {
              into.peers.clear();
              v.read_names([&](const std::string& name, const yaml_value& url) { into.peers[name] = url.as(to_url); });
          }},
         {"workers", count_into(into.workers, 1, max_workers)},
         {"queue", count_into(into.queue, 1, max_queue)},
         {"stuck_after", duration_into(into.stuck_after)},
         {"replacements", count_into(into.replacements, 0, max_workers)},
         {"drain", duration_into(into.drain)},
         {"plugins",
          [&](const yaml_value& v) {
              into.plugins.clear();
              v.read_list([&](const yaml_value& item) { into.plugins.push_back(plugin_of(item)); });
          }},
         {"plugin_path",
          [&](const yaml_value& v) { into.plugin_path = string_list(v, [](const std::string& s) { return s; }); }},
         {"log", [&](const yaml_value& v) { read_log(v, into.log); }},
         {"limits", [&](const yaml_value& v) { read_limits(v, into.limits); }},
         {"busy_poll", duration_into(into.busy_poll)},
         {"real_time", count_into(into.real_time, 0, 99)},
         {"wake_within", [&](const yaml_value& v) { into.wake_within = v.as(to_wake_within); }}});
}

// Calls `each(line, number)` for each line that is not blank or a comment.
template <class F>
void for_each_line(const std::string& text, F&& each) {
    constexpr std::string_view byte_order_mark{"\xEF\xBB\xBF"};
    std::istringstream in{text.starts_with(byte_order_mark) ? text.substr(byte_order_mark.size()) : text};
    std::string line;
    for (std::size_t number = 1; std::getline(in, line); ++number) {
        const auto begin = line.find_first_not_of(" \t\r");
        if (begin != std::string::npos && line[begin] != '#') {
            each(line, number);
        }
    }
}

// Checks the directives outside of documents, because the parser ignores unknown ones.
void check_directives(const std::string& text, const std::string& name) {
    bool outside = true; // of a document
    for_each_line(text, [&](const std::string& line, std::size_t number) {
        if (outside && line.starts_with('%')) {
            if (!line.starts_with("%YAML ") && !line.starts_with("%TAG ")) {
                throw config_error(name + ":" + std::to_string(number),
                                   "is not valid YAML: unknown directive: " + line.substr(0, 40));
            }
            return;
        }
        outside = line.starts_with("...");
    });
}

// A file without settings may contain only comments and document markers.
void check_empty(const std::string& text, const std::string& name) {
    for_each_line(text, [&](const std::string& line, std::size_t number) {
        if (!line.starts_with("---") && !line.starts_with("...") && !line.starts_with('%')) {
            throw config_error(name + ":" + std::to_string(number), "is not a setting: " + line.substr(0, 40));
        }
    });
}

YAML::Node parse(const std::string& text, const std::string& name) {
    try {
        const auto documents = YAML::LoadAll(text);
        if (documents.size() > 1) {
            throw config_error(name, "contains " + std::to_string(documents.size()) + " documents instead of one");
        }
        return documents.empty() ? YAML::Node{} : documents.front();
    } catch (const YAML::Exception& e) {
        const auto line = e.mark.line + 1;
        throw config_error(line > 0 ? name + ":" + std::to_string(line) : name, "is not valid YAML: " + e.msg);
    }
}

} // namespace

void read_config(const std::string& text, const std::string& name, config& into) {
    check_directives(text, name);
    const auto root = parse(text, name);
    if (root.IsNull()) {
        check_empty(text, name);
        return;
    }
    read_all({root, "", name, into.origins}, into);
}

void read_config_file(const std::string& path, config& into) {
    errno = 0;
    std::ifstream in{path, std::ios::binary};
    std::string text(max_file_size + 1, '\0');
    in.read(text.data(), static_cast<std::streamsize>(text.size()));
    if (!in && !in.eof()) {
        throw config_error(path, "cannot be read: " + std::generic_category().message(errno));
    }
    text.resize(static_cast<std::size_t>(in.gcount()));
    if (text.size() > max_file_size) {
        throw config_error(path, "has more than " + std::to_string(max_file_size) + " bytes");
    }
    read_config(text, path, into);
    into.file = path;
}

// -- writing -------------------------------------------------------------------------------------------------------

namespace {

// YAML reads JSON strings.
std::string in_quotes(std::string_view text) {
    std::string out;
    json_writer w{out};
    w.value(text);
    return out;
}

class yaml_lines {
  public:
    explicit yaml_lines(const config& setup) : setup_(setup) {}

    void line(const std::string& key, const std::string& value) {
        const auto origin = setup_.origins.find(key);
        text_ += key + ": " + value + (origin == setup_.origins.end() ? "" : "  # " + origin->second) + "\n";
    }
    void list(const std::string& key, const std::vector<std::string>& items) {
        std::string all;
        for (const auto& item : items) {
            all += (all.empty() ? "" : ", ") + in_quotes(item);
        }
        line(key, "[" + all + "]");
    }
    void raw(const std::string& lines) { text_ += lines; }
    [[nodiscard]] std::string take() { return std::move(text_); }

  private:
    const config& setup_;
    std::string text_;
};

std::string text_of(const multicast_options& where) {
    return where.is_on() ? "{interface: " + in_quotes(where.interface) + ", group: " + where.group +
                               ", port: " + std::to_string(where.port) +
                               ", required: " + (where.required ? "true" : "false") + "}"
                         : "off";
}

std::string text_of(const std::map<std::string, std::string>& peers) {
    std::string all;
    for (const auto& [name, url] : peers) {
        all += (all.empty() ? "" : ", ") + in_quotes(name) + ": " + in_quotes(url);
    }
    return "{" + all + "}";
}

std::string text_of(const std::vector<plugin_config>& plugins) {
    std::string all;
    for (const auto& p : plugins) {
        all += "  - path: " + in_quotes(p.path) + "\n    config: " + p.config +
               "\n    required: " + (p.required ? "true" : "false") + "\n";
    }
    return all.empty() ? "plugins: []\n" : "plugins:\n" + all;
}

std::string limits_text(const limits& bounds, const std::string& indent) {
    std::string text;
    for (const auto& range : count_ranges) {
        text.append(indent).append(range.name) += ": " + std::to_string(bounds.*range.member) + "\n";
    }
    for (const auto& range : time_ranges) {
        text.append(indent).append(range.name) +=
            ": " + to_string(std::chrono::microseconds{bounds.*range.member}) + "\n";
    }
    return text;
}

} // namespace

std::string to_yaml(const config& setup) {
    yaml_lines out{setup};
    out.raw(setup.file.empty() ? "# no configuration file\n" : "# " + setup.file + "\n");
    out.line("node", in_quotes(setup.node));
    out.line("pool", in_quotes(setup.pool));
    out.line("allow_clash", setup.allow_clash ? "true" : "false");
    out.list("listen", setup.listen);
    out.line("insecure", setup.insecure ? "true" : "false");
    out.list("networks", setup.networks);
    out.line("multicast", text_of(setup.multicast));
    out.list("seeds", setup.seeds);
    out.line("peers", text_of(setup.peers));
    out.line("workers", std::to_string(setup.workers));
    out.line("queue", std::to_string(setup.queue));
    out.line("stuck_after", to_string(setup.stuck_after));
    out.line("replacements", std::to_string(setup.replacements));
    out.line("drain", to_string(setup.drain));
    out.list("plugin_path", setup.plugin_path);
    out.raw(text_of(setup.plugins));
    out.line("log", "{level: " + std::string{to_string(setup.log.level)} +
                        ", format: " + std::string{to_string(setup.log.format)} + "}");
    out.line("busy_poll", to_string(setup.busy_poll));
    out.line("real_time", std::to_string(setup.real_time));
    out.line("wake_within", wake_within_text(setup.wake_within));
    out.raw("limits:\n" + limits_text(setup.limits, "  "));
    return out.take();
}

} // namespace cles::runtime
