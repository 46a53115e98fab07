# Reference values for tests/fitter/test_split_plot_reference.py. Run in this directory:
#   Rscript split_plot.R > split_plot.json
# The designs and responses are generated here and in the test from the same rules (Park and Miller's generator is
# exact in double precision); only the answers are stored.
suppressMessages({library(lme4); library(lmerTest); library(pbkrtest); library(nlme); library(jsonlite)})

noise <- function(n, seed) { # sums of twelve uniform numbers less six: close to normal, mean 0, variance 1
  z <- numeric(n)
  for (i in seq_len(n)) {
    total <- 0
    for (j in 1:12) { seed <- (16807 * seed) %% 2147483647; total <- total + seed / 2147483647 }
    z[i] <- total - 6
  }
  z
}

a <- sqrt(2)
temperatures <- cbind(c(-1, 1, -1, 1, -1, 1, -1, 1, -a, a, -a, a, 0, 0, 0, 0, 0, 0, 0, 0),
                      c(-1, -1, 1, 1, -1, -1, 1, 1, 0, 0, 0, 0, -a, a, 0, 0, 0, 0, 0, 0))
pressures <- c(0.01, 0.12, 0.50, 0.79, 1.00, 2.50, 4.00, 5.00, 0.01, 2.50, 5.00)

chamber <- function(replications, wholeplot_sd, replicate_sd, seed) { # the 20 x 11 design, once or several times
  wp <- rep(seq_len(20 * replications), each = 11)
  rep <- (wp - 1) %/% 20 + 1
  p <- rep(pressures, 20 * replications)
  t1 <- temperatures[(wp - 1) %% 20 + 1, 1]; t2 <- temperatures[(wp - 1) %% 20 + 1, 2]
  x <- data.frame(p, t1, t2, pp = p * p, t11 = t1 * t1, t22 = t2 * t2, pt1 = p * t1, pt2 = p * t2, t12 = t1 * t2)
  y <- 1.5 + 2 * p + 0.2 * t1 - 0.1 * t2 + 0.01 * p * p + 0.03 * p * t2 + 0.1 * noise(length(p), seed) +
    wholeplot_sd * noise(20 * replications, seed + 1)[wp] + replicate_sd * noise(replications, seed + 2)[rep]
  cbind(y = y, wp = wp, rep = rep, x)
}

Oats <- as.data.frame(nlme::Oats)
oats <- data.frame(y = Oats$yield, nitro = Oats$nitro, marvellous = 1 * (Oats$Variety == "Marvellous"),
                   victory = 1 * (Oats$Variety == "Victory"), rep = match(Oats$Block, c("I", "II", "III", "IV", "V", "VI")))
oats$wp <- 3 * oats$rep + match(Oats$Variety, c("Golden Rain", "Marvellous", "Victory"))
keep <- function(d) { # whole plot 4 broke after 5 readings, whole plot 9 after one; 15 lost its first three
  place <- (seq_len(nrow(d)) - 1) %% 11 + 1
  d[!((d$wp == 4 & place > 5) | (d$wp == 9 & place > 1) | (d$wp == 15 & place <= 3)), ]
}
lost <- function(d) keep(d)[-c(100, 230, 231, 232, 400:409), ] # and more of later replications

cases <- list(
  oats = list(data = oats, nested = TRUE, tests = list(c("marvellous", "victory"), "nitro")),
  paper = list(data = chamber(1, 0.32, 0, 11), nested = FALSE,
               tests = list(c("t1", "t2", "t11", "t22", "t12"), c("pt1", "pt2"), c("t1", "pt1"))),
  broken = list(data = keep(chamber(1, 0.32, 0, 12)), nested = FALSE,
                tests = list(c("t1", "t2", "t11", "t22", "t12"), c("pt1", "pt2"), c("t1", "pt1"))),
  small_ratio = list(data = keep(chamber(1, 0.04, 0, 13)), nested = FALSE,
                     tests = list(c("t1", "t2", "t11", "t22", "t12"), c("t1", "pt1"))),
  nested = list(data = chamber(3, 0.32, 0.5, 14), nested = TRUE,
                tests = list(c("t1", "t2", "t11", "t22", "t12"), c("pt1", "pt2"))),
  nested_broken = list(data = lost(chamber(3, 0.32, 0.5, 15)), nested = TRUE,
                       tests = list(c("t1", "t2", "t11", "t22", "t12"), c("t1", "pt1"))))

update_call <- function(fit, formula, d) { fit@call <- call("lmer", formula = formula, data = d); fit }

answer <- function(case) {
  d <- case$data
  terms <- setdiff(names(d), c("y", "wp", "rep"))
  fixed <- reformulate(terms, "y")
  random <- if (case$nested) "(1 | rep) + (1 | wp)" else "(1 | wp)"
  formula <- update(fixed, paste(". ~ . +", random))
  default <- lme4::lmer(formula, d)
  other <- nlme::lme(fixed, d, random = if (case$nested) ~ 1 | rep/wp else ~ 1 | wp,
                     control = lmeControl(msMaxIter = 500, tolerance = 1e-12, msTol = 1e-14, niterEM = 100))
  # lme4's optimiser stops short of what pbkrtest is to be compared at; so lme4 is given nlme's maximum
  parts <- lFormula(formula, d)
  deviance <- do.call(mkLmerDevfun, parts)
  ratio <- sapply(other$modelStruct$reStruct, function(s) sqrt(as.matrix(s)[1, 1]))
  theta <- unname(ratio[names(parts$reTrms$cnms)])
  fit <- mkMerMod(environment(deviance), list(par = theta, fval = deviance(theta), conv = 0), parts$reTrms, parts$fr,
                  quote(lmer(formula, d)))
  fit <- as_lmerModLmerTest(update_call(fit, formula, d))
  k <- length(fixef(fit))
  adjusted <- vcovAdj(fit)
  tests <- lapply(case$tests, function(set) {
    L <- diag(k)[match(set, names(fixef(fit))), , drop = FALSE]
    s <- getKR(KRmodcomp(fit, L))
    list(terms = I(set), F = s$Fstat, ndf = s$ndf, ddf = s$ddf, scale = s$F.scaling)
  })
  sd_of <- function(f) { v <- as.data.frame(VarCorr(f)); setNames(as.list(v$sdcor), v$grp) }
  list(names = names(fixef(fit)),
       lme4 = list(coefficients = unname(fixef(fit)), stderr = unname(sqrt(diag(as.matrix(vcov(fit))))),
                   sd = sd_of(fit), loglik = as.numeric(logLik(fit)), blup = ranef(fit)$wp[[1]]),
       lme4_default = list(sd = sd_of(default)),
       nlme = list(coefficients = unname(fixef(other)), stderr = unname(sqrt(diag(vcov(other)))),
                   sd = as.numeric(VarCorr(other)[grepl("Intercept|Residual", rownames(VarCorr(other))), "StdDev"]),
                   loglik = as.numeric(logLik(other))),
       lmerTest = list(df = unname(coef(summary(fit, ddf = "Satterthwaite"))[, "df"])),
       pbkrtest = list(stderr = unname(sqrt(diag(as.matrix(adjusted)))),
                       df = sapply(seq_len(k), function(i) Lb_ddf(diag(k)[i, ], vcov(fit), adjusted)),
                       tests = tests))
}
versions <- sapply(c("lme4", "nlme", "lmerTest", "pbkrtest"), function(p) as.character(packageVersion(p)))
cat(toJSON(list(command = "Rscript split_plot.R > split_plot.json", R = R.version.string, versions = as.list(versions),
                cases = lapply(cases, answer)), digits = NA, auto_unbox = TRUE, pretty = 2), "\n")
