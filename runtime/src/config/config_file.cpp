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

constexpr std::size_t longest_file = 1U << 20U;

// A list of texts, each of which stands for something; one alone may stand without brackets.
template <class F>
std::vector<std::string> texts(const config_node& from, F to) {
    if (from.is_text()) {
        return {from.as(to)};
    }
    std::vector<std::string> all;
    from.list([&](const config_node& item) { all.push_back(item.as(to)); });
    return all;
}

template <class T>
config_node::reader count_into(T& to, std::uint64_t least, std::uint64_t most) {
    return [&to, least, most](const config_node& v) {
        to = static_cast<T>(v.as([&](const std::string& text) { return to_count(text, least, most); }));
    };
}

config_node::reader switch_into(bool& to) {
    return [&to](const config_node& v) { to = v.as(to_switch); };
}

config_node::reader span_into(std::chrono::microseconds& to) {
    return [&to](const config_node& v) { to = v.as(to_duration); };
}

// A text with commas, or a list.
std::string interfaces_of(const config_node& from) {
    if (from.is_text()) {
        return from.as(to_interfaces);
    }
    std::string all;
    from.list([&](const config_node& item) { all += (all.empty() ? "" : ",") + item.as(to_interfaces); });
    try {
        return to_interfaces(all);
    } catch (const bad_value& wrong) {
        from.refuse(wrong.what());
    }
}

multicast_options multicast_of(const config_node& from) {
    if (from.is_text()) {
        return from.as(to_multicast);
    }
    multicast_options read{.interface = "lo"};
    if (from.is_list()) {
        read.interface = interfaces_of(from);
        return read;
    }
    from.map({{"interface", [&](const config_node& v) { read.interface = interfaces_of(v); }},
              {"group",
               [&](const config_node& v) {
                   read.group = v.as([](const std::string& group) { return to_multicast("lo," + group + ":1").group; });
               }},
              {"port", count_into(read.port, 1, 65535)},
              {"required", switch_into(read.required)}});
    return read;
}

void read_log(const config_node& from, log_config& over) {
    if (from.is_text()) {
        over = from.as([&](const std::string& text) { return to_log(text, over); });
        return;
    }
    from.map({{"level", [&](const config_node& v) { over.level = v.as(to_log_level); }},
              {"format", [&](const config_node& v) { over.format = v.as(to_log_format); }}});
}

plugin_config plugin_of(const config_node& from) {
    const auto to_path = [](const std::string& path) {
        if (path.empty()) {
            throw bad_value("is empty");
        }
        return path;
    };
    plugin_config read;
    if (from.is_text()) {
        read.path = from.as(to_path);
        return read;
    }
    from.map({{"path", [&](const config_node& v) { read.path = v.as(to_path); }},
              {"config", [&](const config_node& v) { read.config = v.json(); }},
              {"required", switch_into(read.required)}});
    if (read.path.empty()) {
        from.refuse("has no 'path'");
    }
    return read;
}

constexpr std::size_t most_links = 20'000; // each is a file descriptor, of which a process has fewer

std::size_t most_of(const count_range& range) {
    return range.member == &limits::links || range.member == &limits::links_per_address ? most_links : range.most;
}

std::chrono::milliseconds to_milliseconds(const std::string& text, const time_range& range) {
    // Rounded up: 0 turns some limits off, and what is not 0 must not.
    const auto span = std::chrono::ceil<std::chrono::milliseconds>(to_duration(text));
    const auto bound = [](std::chrono::milliseconds at) { return to_string(std::chrono::microseconds{at}); };
    if (span < range.least) {
        throw bad_value("'" + text + "' is too short: " + bound(range.least) + " at least");
    }
    if (span > range.most) {
        throw bad_value("'" + text + "' is too long: " + bound(range.most) + " at most");
    }
    return span;
}

void read_limits(const config_node& from, limits& over) {
    config_node::readers known;
    for (const auto& range : count_ranges) {
        known.emplace(range.name, [&over, &range](const config_node& v) {
            over.*range.member = v.as([&](const std::string& text) {
                return static_cast<std::size_t>(to_size(text, range.least, most_of(range)));
            });
        });
    }
    for (const auto& range : time_ranges) {
        known.emplace(range.name, [&over, &range](const config_node& v) {
            over.*range.member = v.as([&](const std::string& text) { return to_milliseconds(text, range); });
        });
    }
    from.map(known);
}

void read_all(const config_node& from, config& over) {
    constexpr std::uint64_t most_workers = 1024;
    constexpr std::uint64_t most_queued = 1'000'000;
    from.map({{"node", [&](const config_node& v) { over.node = v.as(to_node_name); }},
              {"pool", [&](const config_node& v) { over.pool = v.as(to_pool_name); }},
              {"allow_clash", switch_into(over.allow_clash)},
              {"listen", [&](const config_node& v) { over.listen = texts(v, to_url); }},
              {"insecure", switch_into(over.insecure)},
              {"networks", [&](const config_node& v) { over.networks = texts(v, to_network); }},
              {"multicast", [&](const config_node& v) { over.multicast = multicast_of(v); }},
              {"seeds", [&](const config_node& v) { over.seeds = texts(v, to_url); }},
              {"peers",
               [&](const config_node& v) {
                   over.peers.clear();
                   v.names([&](const std::string& name, const config_node& url) { over.peers[name] = url.as(to_url); });
               }},
              {"workers", count_into(over.workers, 1, most_workers)},
              {"queue", count_into(over.queue, 1, most_queued)},
              {"stuck_after", span_into(over.stuck_after)},
              {"replacements", count_into(over.replacements, 0, most_workers)},
              {"drain", span_into(over.drain)},
              {"plugins",
               [&](const config_node& v) {
                   over.plugins.clear();
                   v.list([&](const config_node& item) { over.plugins.push_back(plugin_of(item)); });
               }},
              {"plugin_path",
               [&](const config_node& v) { over.plugin_path = texts(v, [](const std::string& s) { return s; }); }},
              {"log", [&](const config_node& v) { read_log(v, over.log); }},
              {"limits", [&](const config_node& v) { read_limits(v, over.limits); }},
              {"busy_poll", span_into(over.busy_poll)},
              {"real_time", count_into(over.real_time, 0, 99)},
              {"wake_within", [&](const config_node& v) { over.wake_within = v.as(to_wake_bound); }}});
}

// Calls `each(line, number)` for the lines that hold more than blanks and a comment.
template <class F>
void for_lines(const std::string& text, F&& each) {
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

// Directives before and after a document, which the parser passes over in silence, whatever they say.
void check_directives(const std::string& text, const std::string& name) {
    bool outside = true; // of a document
    for_lines(text, [&](const std::string& line, std::size_t number) {
        if (outside && line.starts_with('%')) {
            if (!line.starts_with("%YAML ") && !line.starts_with("%TAG ")) {
                throw config_error(name + ":" + std::to_string(number),
                                   "is no YAML: unknown directive: " + line.substr(0, 40));
            }
            return;
        }
        outside = line.starts_with("...");
    });
}

// A file without settings holds comments, and the marks of a document at most.
void check_empty(const std::string& text, const std::string& name) {
    for_lines(text, [&](const std::string& line, std::size_t number) {
        if (!line.starts_with("---") && !line.starts_with("...") && !line.starts_with('%')) {
            throw config_error(name + ":" + std::to_string(number), "holds no setting: " + line.substr(0, 40));
        }
    });
}

YAML::Node parse(const std::string& text, const std::string& name) {
    try {
        const auto documents = YAML::LoadAll(text);
        if (documents.size() > 1) {
            throw config_error(name, "holds " + std::to_string(documents.size()) + " documents, not one");
        }
        return documents.empty() ? YAML::Node{} : documents.front();
    } catch (const YAML::Exception& wrong) {
        const auto line = wrong.mark.line + 1;
        throw config_error(line > 0 ? name + ":" + std::to_string(line) : name, "is no YAML: " + wrong.msg);
    }
}

} // namespace

void read_config(const std::string& text, const std::string& name, config& over) {
    check_directives(text, name);
    const auto whole = parse(text, name);
    if (whole.IsNull()) {
        check_empty(text, name);
        return;
    }
    read_all({whole, "", name, over.origins}, over);
}

void read_config_file(const std::string& path, config& over) {
    errno = 0;
    std::ifstream in{path, std::ios::binary};
    std::string text(longest_file + 1, '\0');
    in.read(text.data(), static_cast<std::streamsize>(text.size()));
    if (!in && !in.eof()) {
        throw config_error(path, "cannot be read: " + std::generic_category().message(errno));
    }
    text.resize(static_cast<std::size_t>(in.gcount()));
    if (text.size() > longest_file) {
        throw config_error(path, "has more than " + std::to_string(longest_file) + " bytes");
    }
    read_config(text, path, over);
    over.file = path;
}

// -- writing -------------------------------------------------------------------------------------------------------

namespace {

// JSON's quotes are YAML's.
std::string in_quotes(std::string_view text) {
    std::string out;
    json_writer w{out};
    w.value(text);
    return out;
}

class yaml_lines {
  public:
    explicit yaml_lines(const config& whole) : whole_(whole) {}

    void line(const std::string& key, const std::string& value) {
        const auto origin = whole_.origins.find(key);
        text_ += key + ": " + value + (origin == whole_.origins.end() ? "" : "  # " + origin->second) + "\n";
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
    const config& whole_;
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

std::string to_yaml(const config& whole) {
    yaml_lines out{whole};
    out.raw(whole.file.empty() ? "# no configuration file\n" : "# " + whole.file + "\n");
    out.line("node", in_quotes(whole.node));
    out.line("pool", in_quotes(whole.pool));
    out.line("allow_clash", whole.allow_clash ? "true" : "false");
    out.list("listen", whole.listen);
    out.line("insecure", whole.insecure ? "true" : "false");
    out.list("networks", whole.networks);
    out.line("multicast", text_of(whole.multicast));
    out.list("seeds", whole.seeds);
    out.line("peers", text_of(whole.peers));
    out.line("workers", std::to_string(whole.workers));
    out.line("queue", std::to_string(whole.queue));
    out.line("stuck_after", to_string(whole.stuck_after));
    out.line("replacements", std::to_string(whole.replacements));
    out.line("drain", to_string(whole.drain));
    out.list("plugin_path", whole.plugin_path);
    out.raw(text_of(whole.plugins));
    out.line("log", "{level: " + std::string{to_string(whole.log.level)} +
                        ", format: " + std::string{to_string(whole.log.format)} + "}");
    out.line("busy_poll", to_string(whole.busy_poll));
    out.line("real_time", std::to_string(whole.real_time));
    out.line("wake_within", wake_bound_text(whole.wake_within));
    out.raw("limits:\n" + limits_text(whole.limits, "  "));
    return out.take();
}

} // namespace cles::runtime
