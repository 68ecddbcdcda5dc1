// SPDX-License-Identifier: BSL-1.0
// The subscriber that update_cost.py measures by the instructions that it executes.
//
//   cles_update_cost URL UPDATES STYLE FORM    binds car1:localization there, and ends when it has received so many
//                                              updates. STYLE: coroutine, callback or batch; FORM: raw or typed
//   cles_update_cost read UPDATES FORM         reads the values of as many updates, and does nothing else
//   cles_update_cost print UPDATES             prints the lines of the updates
#include <cles/feed_batch.hpp>
#include <cles/run.hpp>
#include <cles/service.hpp>

#include "feed_reader.hpp"
#include "perf/support/handler_style.hpp"
#include "perf/support/localization.hpp"

#include <boost/asio/io_context.hpp>

#include <array>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace {

namespace perf = cles::perf;

class one_pass {
  public:
    one_pass(boost::asio::io_context& io, cles::service& client, std::uint64_t updates)
        : updates_(updates), io_(io), client_(client) {}

    [[nodiscard]] std::uint64_t updates() const noexcept { return updates_; }
    /// Has the publisher begin.
    void bound() {
        client_.async_push("car1:publish", cles::json_text{}, [](boost::system::error_code, const cles::json_text&) {});
    }
    void complete() { io_.stop(); }
    void fail(std::exception_ptr failure) {
        failure_ = std::move(failure);
        io_.stop();
    }
    [[nodiscard]] const std::exception_ptr& failure() const noexcept { return failure_; }

  private:
    std::uint64_t updates_;
    boost::asio::io_context& io_;
    cles::service& client_;
    std::exception_ptr failure_;
};

template <class T>
class counting_reader : public perf::feed_reader<counting_reader<T>, T, one_pass> {
  public:
    counting_reader(one_pass& all, perf::handler_style style)
        : perf::feed_reader<counting_reader, T, one_pass>(all, style, 0) {}

    bool take(const cles::feed_item<T>& item) {
        if (item.kind != cles::feed_event::update || item.seq != ++received_) {
            throw std::runtime_error("update " + std::to_string(received_) + " is missing");
        }
        if (received_ != this->all_.updates()) {
            return true;
        }
        this->all_.complete();
        return false;
    }

  private:
    std::uint64_t received_ = 0;
};

template <class T>
void follow(const std::string& url, std::uint64_t updates, perf::handler_style style) {
    boost::asio::io_context io{1};
    const std::unique_ptr<cles::service> client =
        std::make_unique<cles::service>(io, cles::service_options{.name = "bench", .peers = {{"car1", url}}});
    one_pass all{io, *client, updates};
    const auto reader = std::make_unique<counting_reader<T>>(all, style);
    reader->start(io, *client);
    perf::run_pass(io, {}, all, std::array{client.get()}, std::array{reader.get()});
}

// As a feed reads them: text is checked and copied.
template <class T>
void read(std::uint64_t updates) {
    std::array<std::string, 64> texts;
    for (std::size_t i = 0; i < texts.size(); ++i) {
        texts[i] = cles::to_json(perf::sample(i));
    }
    for (std::uint64_t i = 0; i < updates; ++i) {
        T value;
        if (!cles::from_json(texts[i % texts.size()], value)) {
            throw std::runtime_error("a value cannot be read");
        }
        asm volatile("" : : "r"(&value) : "memory"); // otherwise the compiler would leave out what is not used
    }
}

void print(std::uint64_t updates) {
    for (std::uint64_t i = 1; i <= updates; ++i) {
        std::printf("UPDATE car1:localization seq=%ju epoch=5f3a09c1 %s\n", static_cast<std::uintmax_t>(i),
                    cles::to_json(perf::sample(i)).c_str());
    }
}

std::uint64_t count_of(std::string_view text) {
    std::uint64_t count = 0;
    const auto [end, wrong] = std::from_chars(text.data(), text.data() + text.size(), count);
    if (wrong != std::errc{} || end != text.data() + text.size() || count == 0) {
        throw std::invalid_argument("not a number of updates: " + std::string{text});
    }
    return count;
}

perf::handler_style style_of(std::string_view name) {
    if (name == "batch") {
        return perf::handler_style::batch;
    }
    return name == "callback" ? perf::handler_style::callback : perf::handler_style::coroutine;
}

void run(std::span<const std::string_view> words) {
    const auto updates = count_of(words[1]);
    const bool is_typed = words.back() == "typed";
    if (words.size() == 2 && words[0] == "print") {
        print(updates);
    } else if (words.size() == 3 && words[0] == "read") {
        is_typed ? read<perf::localization>(updates) : read<cles::json_text>(updates);
    } else if (words.size() == 4) {
        const std::string url{words[0]};
        is_typed ? follow<perf::localization>(url, updates, style_of(words[2]))
                 : follow<cles::json_text>(url, updates, style_of(words[2]));
    } else {
        throw std::invalid_argument("the arguments are URL UPDATES STYLE FORM, read UPDATES FORM, or print UPDATES");
    }
}

} // namespace

int main(int argc, char** argv) {
    try {
        const std::vector<std::string_view> words(argv + 1, argv + argc);
        if (words.size() < 2) {
            throw std::invalid_argument("see the comment in update_cost.cpp");
        }
        run(words);
        return 0;
    } catch (const std::exception& failure) {
        std::fprintf(stderr, "cles_update_cost: %s\n", failure.what());
        return 1;
    }
}
