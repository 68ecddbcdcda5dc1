// SPDX-License-Identifier: BSL-1.0
// A plugin whose jobs append a line "number node" to a file when they run, so that a test sees which ones ran, even if
// their node cannot answer any more. Noun: task/number/milliseconds of work. One returns its body instead.
#include <cles/plugin.hpp>

#include <boost/describe/class.hpp>

#include <chrono>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>

#include <fcntl.h>
#include <unistd.h>

namespace {

using namespace std::chrono_literals;

struct settings {
    std::string marks; // the file
};
BOOST_DESCRIBE_STRUCT(settings, (), (marks))

class mark_file {
  public:
    explicit mark_file(const std::string& path)
        : file_(::open(path.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600)) {
        if (file_ < 0) {
            throw std::runtime_error{"there is no file for marks"};
        }
    }
    mark_file(const mark_file&) = delete;
    mark_file& operator=(const mark_file&) = delete;
    ~mark_file() { ::close(file_); }

    // A single write at the end of the file, so that lines of several writers do not mix.
    void leave(const cles::request& asked) const {
        const auto line = std::string{asked.parameter(0)} + " " + std::string{asked.node()} + "\n";
        if (::write(file_, line.data(), line.size()) != static_cast<ssize_t>(line.size())) {
            throw std::runtime_error{"the mark was not written"};
        }
    }

  private:
    int file_;
};

void work(const cles::request& asked) {
    std::this_thread::sleep_for(std::chrono::milliseconds{asked.parameter<int>(1)});
}

void register_tasks(cles::registrar& to, const settings& wanted) {
    const auto marks = std::make_shared<const mark_file>(wanted.marks);
    const auto count = [marks](const cles::request& asked) {
        marks->leave(asked);
        work(asked);
        return std::string{asked.node()};
    };
    to.on_delegate("once", count);
    to.on_delegate("again", count, {.idempotent = true});
    to.on_delegate("ordered", count, {.must_be_signed = true});
    to.on_delegate("fails", [marks](const cles::request& asked) {
        marks->leave(asked);
        throw std::runtime_error{"as it should"};
    });
    // Both run until they are stopped; only the first may move to another node.
    const auto hold = [marks](const cles::request& asked, const cles::responder& answer) {
        marks->leave(asked);
        while (!answer.stopped()) {
            std::this_thread::sleep_for(2ms);
        }
        answer.fail(cles::errc::cancelled, "nobody waits");
    };
    to.on_delegate("holds", hold);
    to.on_delegate("holds_here", hold, {.local = true});
    to.on_delegate("returns", [](const cles::request& asked) { return cles::json_text{std::string{asked.body()}}; });
}

} // namespace

CLES_PLUGIN("counting", "1.0", register_tasks)
