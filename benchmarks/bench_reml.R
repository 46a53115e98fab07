# Called by bench_reml.py: Rscript bench_reml.R DATA.csv, with columns whole_plot, y1 ... ym and the model's own.
# Prints JSON: milliseconds a fit (medians) and estimates of lme4::lmer, lme4::refit and nlme::lme on every response.
suppressMessages({library(lme4); library(nlme); library(jsonlite)})
d <- read.csv(commandArgs(TRUE)[1])
responses <- grep("^y[0-9]+$", names(d), value = TRUE)
terms <- setdiff(names(d), c("whole_plot", responses))
ms <- function(expression) { start <- Sys.time(); force(expression); 1e3 * as.numeric(Sys.time() - start, units = "secs") }
quiet <- function(expression) suppressMessages(suppressWarnings(expression))
of_lme4 <- function(f) c(as.data.frame(VarCorr(f))$sdcor, sqrt(diag(as.matrix(vcov(f)))))
of_nlme <- function(f) c(f$sigma * sqrt(as.matrix(f$modelStruct$reStruct[[1]])[1, 1]), f$sigma, sqrt(diag(vcov(f))))

fixed <- reformulate(terms, "y")
d$y <- d[[responses[1]]]
first <- quiet(lmer(update(fixed, . ~ . + (1 | whole_plot)), d))
answers <- list(lmer = list(), refit = list(), lme = list())
times <- matrix(NA, length(responses), 3)
for (i in seq_along(responses)) {
  d$y <- d[[responses[i]]]
  times[i, 1] <- ms(a <- quiet(lmer(update(fixed, . ~ . + (1 | whole_plot)), d)))
  times[i, 2] <- ms(b <- quiet(refit(first, d$y)))
  times[i, 3] <- ms(c <- tryCatch(quiet(lme(fixed, d, random = ~ 1 | whole_plot)), error = function(e) NULL))
  answers$lmer[[i]] <- unname(of_lme4(a))
  answers$refit[[i]] <- unname(of_lme4(b))
  answers$lme[[i]] <- if (is.null(c)) rep(NA, length(terms) + 3) else unname(of_nlme(c))
}
versions <- sapply(c("lme4", "nlme"), function(p) as.character(packageVersion(p)))
cat(toJSON(list(ms = setNames(as.list(apply(times, 2, median)), names(answers)), versions = as.list(versions),
                answers = answers), digits = NA, auto_unbox = TRUE, na = "null"))
