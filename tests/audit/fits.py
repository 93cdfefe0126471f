"""Auditor of a fit's folder: card, moduli, coefficients, residuals, starts, verdict."""

import math
import re

import numpy as np
from scipy.stats import chi2

from . import biaxial, bubbles, cycles, strips, tubes
from .common import claim_literal
from .laws import DIRECTION, MODULI, MPA
from .ledger import NUM, as_number

#: Strains of the tables "The answer", beside the end.
STRAINS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3)
WORDS = {
    "E1": "Young's modulus along the warp, E1",
    "E2": "Young's modulus along the fill, E2",
    "G12": "Shear modulus between warp and fill, G12",
}
#: Relative one sigma of a modulus of which nothing is known before the tests.
PRIOR = 10.0
#: A modulus is usable where its 95 % band is within a fifth of it.
USABLE = 0.2
#: One sigma, relative, from which on a modulus is not determined.
LARGEST_SIGMA = 1.0
#: Two starts end in one optimum where objectives and moduli differ by no more, relative; an
#: objective that is larger than the best by no more is as good.
SAME_OBJECTIVE, SAME_MODULI, AS_GOOD = 0.01, 0.02, 1e-4
#: What notes of a kind say against the moduli, in the words of the verdict.
UNUSABLE = {
    "sheet taken for flat": "the sheet of a real bubble is taken for flat, so that its moduli are "
    "not to be believed",
    "not converged": "the fit has not converged",
    "mesh error too large": "the error of the mesh is too large to be taken out",
}
AGAINST = {
    "on its margin": "bounds are reached",
    "on a bound": "bounds are reached",
    "mesh error": "the error of the mesh is large",
    "wrong form": "the form of the law or the model is wrong",
    "cause of the misfit": "what the fit leaves has the shape of a fault of the test",
    "unstable": "equilibria of the model are unstable",
    "doubtful data": "the data are doubtful",
    "unfaithful surfaces": "polynomial surfaces bias the moduli",
    "extensometer slip": "an extensometer slipped",
}
NO_CERTAINTY = "the solver gives no derivatives, so that the uncertainty is not known"
NOTHING_USABLE = "no modulus is known to ±20 % at any strain"
KINDS = {"bubble": bubbles, "strips": strips, "biaxial": biaxial, "cycles": cycles, "tube": tubes}


def percent(value):
    """Return a fraction in percent as the page prints it: two digits, whole from 100 % on."""
    return f"{100 * value:.0f} %" if value >= 0.995 else f"{100 * value:.2g} %"


def audit_fit(folder, ledger):
    """Audit everything in the folder of a fit."""
    audit = FitAudit(folder, ledger)
    audit.law()
    audit.moduli()
    audit.coefficients()
    audit.residuals()
    audit.starts()
    audit.uncertainty()
    audit.verdict()
    audit.unknowns()
    audit.page()
    audit.notes()
    audit.tests()
    if "tangent moduli at logarithmic strains" in folder.terminal:
        audit.terminal()


class FitAudit:
    """What the parts of an audit share."""

    def __init__(self, folder, ledger):
        self.folder, self.ledger, self.result = folder, ledger, folder.result
        self.card = folder.card
        self.table = folder.data("moduli.csv")
        self.matched = folder.data("residuals.csv")
        self.several = len(self.result["tests"]) > 1

    # The law

    def law(self):
        """Card and result.json hold the same law; units and labels are its form's."""
        ledger, card, result = self.ledger, self.folder.card_text, self.result
        ledger.json(("beta", "values"), card["beta"], "consistent", rel=1e-12)
        ledger.json(("beta", "unit"), card["unit"])
        ledger.json("nu12", card["nu12"], "consistent", rel=1e-12)
        unit = self.folder.project.get("units", {}).get("modulus", "GPa")
        if card["unit"] != unit:
            ledger.find("material.toml: unit", f"is {card['unit']}; the project's is {unit}")
        for key, own in (("knots", card.get("knots")), ("breaks", card.get("breaks"))):
            if own is not None and key in result:
                ledger.json(key, own, "consistent", rel=1e-12)
        ledger.claim_json("beta", "recomputed", file="material.toml")
        for key in ("nu12", "thickness_mm"):
            ledger.claim_json(key, "consistent", file="material.toml")
        number = 4 if "memory" in card else 3 if "certainty" in card else 2
        ledger.json("format", number, "echoed", file="material.toml")
        self._memory(card)
        for name, key in DIRECTION.items():
            low, high = card["valid_strain"][key]
            ledger.json(("valid_strain", key), [0.0, result["valid_strain"][key]], "consistent",
                        file="material.toml")  # fmt: skip
            ledger.json(("valid_strain", key), high, "consistent")
            if low != 0.0 or high != self.card.ends[name]:
                ledger.find(f"material.toml: valid_strain.{key}", "does not begin at zero")
        fabric = self.folder.project.get("fabric", {})
        fitted = "thickness" in self.names_of_unknowns()
        if not fitted and fabric.get("thickness") != card["thickness_mm"]:
            ledger.find("material.toml: thickness_mm", f"expected {fabric.get('thickness')}")
        law = self.folder.project.get("law", {})
        if "nu12" not in self.names_of_unknowns() and card["nu12"] != law.get("nu12", 0.24):
            ledger.find("material.toml: nu12", f"expected {law.get('nu12', 0.24)}")
        self.ranges = law.get("strain_range") or self._ranges_of_tests()
        for k, key in enumerate(DIRECTION.values()):
            reached = result["strain_reached"][key]
            self._reached(k, key)
            limit = max(min(reached, self.ranges[k]), 1e-6)
            ledger.json(("valid_strain", key), limit, "recomputed", rel=1e-9)
        self._certainty()
        self._source()

    def _memory(self, card):
        """Constants of the memory are those of the unknowns, where they are fitted."""
        unknowns = self.result.get("unknowns", {})
        for key, values in card.get("memory", {}).items():
            name = key.removeprefix("permanent_")
            for k, direction in enumerate(DIRECTION.values()):
                own = unknowns.get(f"{name}_{direction}")
                path = ("memory", key, k)
                if own is None:
                    self.ledger.claim_json(path, "echoed", file="material.toml")
                else:
                    self.ledger.json(path, own["value"], "consistent", file="material.toml")
            if len(values) != 3:
                self.ledger.find(f"material.toml: memory.{key}", "has not three directions")

    def _ranges_of_tests(self):
        """Return how far strips go along warp and fill, and the shear of bias strips and tubes."""
        ranges = [-math.inf] * 3
        for test, numbers in self.result["tests"].items():
            kind, section = self.kind_of(test)
            if kind == "tube":
                ranges[2] = max(ranges[2], tubes.largest_shear(self, section))
            angle = section.get("bias_angle", 45.0)
            for direction, own in numbers.get("directions", {}).items():
                strain = math.log(own["final_length_mm"] / own["gauge_length_mm"])
                factor = 2 * math.sin(math.radians(2 * angle)) if direction == "bias" else 1.0
                k = ("warp", "fill", "bias").index(direction)
                ranges[k] = max(ranges[k], factor * strain)
        return [end if math.isfinite(end) else math.inf for end in ranges]

    def _reached(self, component, key):
        """The largest strain is that of the best start, and at least that of straight strips."""
        ledger, result = self.ledger, self.result
        records = [r for r in self.folder.starts if r["objective"] is not None and r.get("reached")]
        if records:
            best = min(records, key=lambda r: r["objective"])
            ledger.json(("strain_reached", key), max(best["reached"][component], 1e-6),
                        "consistent", rel=0.02, abs=2e-4)  # fmt: skip
        else:  # a report from Python: the card goes as far, but for the range of the law
            ledger.claim_json(("strain_reached", key), "consistent")
        for numbers in result["tests"].values():
            own = numbers.get("directions", {}).get(key)
            if own is not None:
                strain = math.log(own["final_length_mm"] / own["gauge_length_mm"])
                if result["strain_reached"][key] < strain * (1 - 1e-6):
                    ledger.find(f"result.json: strain_reached.{key}", f"a strip has {strain:.4g}")

    def _certainty(self):
        """The certainty of the card: its band is that of moduli.csv, its sigmas that of noise."""
        card, ledger = self.folder.card_text, self.ledger
        sure = card.get("certainty")
        if sure is None:
            return
        ledger.claim_json(("certainty", "directions"), "consistent", file="material.toml")
        ledger.text(r"(\d+) values of ", [len(self.matched)], "recomputed", source="material.toml")
        directions = np.array(sure["directions"]) * MPA[card["unit"]]
        for name in MODULI:
            rows = self.card.rows(name, 0.5 * self.card.ends[name])[:, self.card.free]
            sigma = float(np.linalg.norm(rows @ directions.T))
            modulus = float(self.card.modulus(name, 0.5 * self.card.ends[name]))
            table = self.table[self.table["modulus"] == name]
            told = np.interp(0.5 * self.card.ends[name], table["strain"], table["sigma_relative"])
            # Draws within the bounds against a sigma without bounds: far apart where hardly known.
            if told < 0.1 and not 0.5 < sigma / modulus / told < 2.0:
                ledger.find(
                    f"material.toml: certainty.directions of {name}",
                    f"sigma {sigma / modulus:.3g} beside {told:.3g} in moduli.csv",
                )
        for name, band in sure.get("band", {}).items():
            table = self.table[self.table["modulus"] == name]
            scale = MPA[card["unit"]]
            strain, lower, upper = (np.array(row, dtype=float) for row in _rows(band))
            at = (
                np.interp(table["strain"], strain, lower),
                np.interp(table["strain"], strain, upper),
            )
            for own, column in zip(at, ("lower_MPa", "upper_MPa"), strict=True):
                if not np.allclose(own * scale, table[column], rtol=1e-5, atol=1e-9):
                    ledger.find(f"material.toml: certainty.band.{name}", f"is not {column}")
            ledger.claim_json(("certainty", "band", name), "consistent", file="material.toml")
        if "laws" in sure:
            self._laws_of_card(np.array(sure["laws"]["beta"]) * MPA[card["unit"]])

    def _laws_of_card(self, coefficients):
        """Nearly all of the drawn laws lie in the band of every modulus."""
        self.ledger.claim_json(("certainty", "laws", "beta"), "consistent", file="material.toml")
        for name in MODULI:
            strain = 0.5 * self.card.ends[name]
            drawn = coefficients @ self.card.rows(name, strain)[:, self.card.free].ravel()
            table = self.table[self.table["modulus"] == name]
            lower, upper = (
                np.interp(strain, table["strain"], table[column])
                for column in ("lower_MPa", "upper_MPa")
            )
            room = 1e-6 * upper
            if ((drawn >= lower - room) & (drawn <= upper + room)).mean() < 0.85:
                self.ledger.find(f"material.toml: certainty.laws of {name}", "leave the band")

    def _source(self):
        """Words of the card on objective and misfit, and on the closed path of strain."""
        objective = self.result["objective"]
        self.ledger.text(r"bubblefit [\w.]+ \w+, .*, objective ([^,\s]+),", [objective])

    # Its tables

    def moduli(self):
        """moduli.csv from the card: 61 strains a modulus up to the end of the valid ones."""
        ledger, table = self.ledger, self.table
        ledger.column("moduli.csv", "modulus", np.repeat(MODULI, 61), "echoed")
        strain = np.concatenate([np.linspace(0.0, self.card.ends[name], 61) for name in MODULI])
        ledger.column("moduli.csv", "strain", strain, rel=1e-8, abs=1e-15)
        exact = np.concatenate(
            [self.card.modulus(name, np.linspace(0.0, self.card.ends[name], 61)) for name in MODULI]
        )
        ledger.column("moduli.csv", "MPa", exact, rel=1e-8)
        for column in ("lower_MPa", "upper_MPa"):
            ledger.claim_column("moduli.csv", column, "consistent")
        wrong = ~((table["lower_MPa"] <= table["MPa"] * (1 + 1e-8)) & (
            table["MPa"] <= table["upper_MPa"] * (1 + 1e-8)))  # fmt: skip
        if "lower_MPa" in table and table["lower_MPa"].notna().all() and wrong.any():
            ledger.find("moduli.csv", f"{int(wrong.sum())} moduli lie outside their band")
        if (table["MPa"] <= 0).any():
            ledger.find("moduli.csv", "a modulus is not positive")
        self._sigmas()
        self._bounds_of_bands()

    def _sigmas(self):
        """The noise has a part of sigma_relative, and the band holds two of it; what is marked."""
        ledger, table = self.ledger, self.table
        noise, mesh = table["noise_relative"], table["mesh_relative"]
        if noise.isna().all():
            return
        ledger.claim_column("moduli.csv", "noise_relative", "consistent")
        ledger.claim_column("moduli.csv", "mesh_relative", "consistent")
        for column in ("sigma_relative", "at_lower_bound", "at_upper_bound"):
            ledger.claim_column("moduli.csv", column, "consistent")
        if (noise > table["sigma_relative"] * (1 + 1e-8)).any():
            ledger.find("moduli.csv: noise_relative", "is more than sigma_relative")
        if mesh.isna().all() and not np.allclose(noise, table["sigma_relative"], rtol=1e-8):
            ledger.find("moduli.csv: noise_relative", "is not sigma_relative, and no mesh error is")
        width = table["upper_MPa"] - table["lower_MPa"]
        if (width < 2 * table["sigma_relative"] * table["MPa"] * (1 - 1e-7)).any():
            ledger.find("moduli.csv: sigma_relative", "is wider than the band")
        known = [str(own) for own in self.determined]
        ledger.column("moduli.csv", "determined", np.array(known, object))
        if (table["sigma_relative"] < 0).any():
            ledger.find("moduli.csv: sigma_relative", "is negative")

    @property
    def determined(self):
        """Whether each row of moduli.csv is determined: sigma, and a band with a free end."""
        both = flags(self.table["at_lower_bound"]) & flags(self.table["at_upper_bound"])
        return (self.table["sigma_relative"].to_numpy() < LARGEST_SIGMA) & ~both

    def _on_bound(self, own):
        """Return whether each row of a modulus is a bound of the fit, which ends its band."""
        lower = flags(own["at_lower_bound"]) & (own["MPa"] <= own["lower_MPa"]).to_numpy()
        upper = flags(own["at_upper_bound"]) & (own["MPa"] >= own["upper_MPa"]).to_numpy()
        return lower | upper

    def determined_at(self, name, strain):
        """Whether a modulus is determined at a strain between those of moduli.csv."""
        own = self.table["modulus"] == name
        strains = self.table["strain"][own]
        lower, upper = (
            np.interp(strain, strains, flags(self.table[f"at_{end}_bound"])[own]) > 0.5
            for end in ("lower", "upper")
        )
        sigma = np.interp(strain, strains, self.table["sigma_relative"][own])
        return sigma < LARGEST_SIGMA and not (lower and upper), lower, upper

    def _bounds_of_bands(self):
        """Bands lie within the bounds that the project gives for the moduli."""
        bounds = self.folder.project.get("law", {}).get("bounds", {})
        scale = MPA[self.folder.project.get("units", {}).get("modulus", "GPa")]
        for name in MODULI:
            if name in bounds:
                low, high = (scale * end for end in bounds[name])
                own = self.table[self.table["modulus"] == name]
                if (own["lower_MPa"] < low * (1 - 1e-6)).any() or (
                    own["upper_MPa"] > high * (1 + 1e-6)
                ).any():
                    self.ledger.find(f"moduli.csv: {name}", "the band goes beyond the bounds")

    def names_of_unknowns(self):
        return list(self.result.get("unknowns", {}))

    def coefficients(self):
        """coefficients.csv: values of the card, bounds of the project, correlations."""
        ledger, card = self.ledger, self.card
        table = self.folder.data("coefficients.csv")
        free = [str(label) for label in card.labels]
        nuisance = self.names_of_unknowns()
        names = [*free, *nuisance]
        file, size = "coefficients.csv", len(free)
        ledger.column(file, "unknown", np.array(names), "echoed")
        unit = self.folder.card_text["unit"]
        unknowns = self.result.get("unknowns", {})
        units = [unit] * size + [unknowns[name]["unit"] for name in nuisance]
        ledger.column(file, "unit", np.array(units), "echoed")
        of_law = slice(0, size)
        ledger.column(file, "value", card.beta[card.free], "consistent", rel=1e-8, rows=of_law)
        beside = slice(size, None)
        for column, key in (("value", "value"), ("sigma", "sigma")):
            values = np.array([unknowns[name][key] for name in nuisance], dtype=float)
            ledger.column(file, column, values, "consistent", rel=1e-8, rows=beside)
        for k, column in enumerate(("lower_bound", "upper_bound")):
            values = np.array([unknowns[name]["bounds"][k] for name in nuisance], dtype=float)
            ledger.column(file, column, values, "consistent", rel=1e-8, rows=beside)
        self._sigma_of_coefficients(table, size)
        self._bounds_of_coefficients(table, size)
        self._correlations(table, names)

    def _sigma_of_coefficients(self, table, size):
        """Their covariance gives the noise of the moduli."""
        ledger, card = self.ledger, self.card
        sigma = table["sigma"].to_numpy(float)[:size]
        ledger.claim_column("coefficients.csv", "sigma", "consistent", rows=np.arange(size))
        if not np.isfinite(sigma).all():
            return
        names = [*card.labels]
        correlation = table[names].to_numpy(float)[:size]
        covariance = correlation * np.outer(sigma, sigma)
        for name in MODULI:
            own = self.table[self.table["modulus"] == name]
            # Ends and middle are strains of the fit itself.
            for at in (0, 30, 60):
                strain = own["strain"].iloc[at]
                rows = card.rows(name, strain)[0, card.free]
                told = own["noise_relative"].iloc[at]
                spread = card.mpa * np.sqrt(max(rows @ covariance @ rows, 0.0))
                relative = spread / float(card.modulus(name, strain))
                if self.second_order or self.mesh_taken_out:
                    right = told / 3 < relative < 3 * told
                else:
                    # Bounds, which coefficients leave aside, make moduli surer, not less sure.
                    right = relative / 3 <= told + 1e-6 and told <= 1.1 * relative + 1e-6
                # Bounds, which coefficients leave aside, make the sigmas of what is hardly known.
                if not right and relative < 0.2:
                    ledger.find(
                        f"coefficients.csv: {name} at {strain:.3g}",
                        f"sigmas and correlations give {relative:.4g}; moduli.csv has {told:.4g}",
                    )

    @property
    def second_order(self):
        order = self.result.get("uncertainty", {}).get("second_order")
        return order is not None and order["order"] == 2

    @property
    def mesh_taken_out(self):
        return self.result.get("uncertainty", {}).get("mesh_error") == "taken out"

    def _bounds_of_coefficients(self, table, size):
        """Bounds are the project's, in its unit, where it bounds coefficients or constants."""
        ledger, form = self.ledger, self.card.form
        bounds = self.folder.project.get("law", {}).get("bounds", {})
        rows = np.arange(size)
        ends = None
        if "lower" in bounds:
            ends = [bounds["lower"], bounds["upper"]]
            if len(ends[0]) == len(self.card.beta) != size:
                ends = [[own[k] for k in self.card.free] for own in ends]
        elif form == "constant" and set(MODULI) <= set(bounds):
            ends = [[bounds[name][k] for name in ("G12", "E2", "E1")] for k in (0, 1)]
        elif form.startswith("spline") and set(MODULI) <= set(bounds):
            ends = [[bounds[label.split()[0]][k] for label in self.card.labels] for k in (0, 1)]
        for k, column in enumerate(("lower_bound", "upper_bound")):
            if ends is None:
                ledger.claim_column("coefficients.csv", column, "consistent", rows=rows)
                continue
            own = np.array(ends[k], dtype=float)
            ledger.column("coefficients.csv", column, own, "echoed", rel=1e-8, rows=rows)
        low, value, high = (
            table[name].to_numpy(float)[:size] for name in ("lower_bound", "value", "upper_bound")
        )
        room = 1e-6 * np.abs(value)
        # The fit keeps the bounds; what takes the error of the mesh out may move the law.
        if not self.mesh_taken_out and ((value < low - room) | (value > high + room)).any():
            ledger.find("coefficients.csv", "a value lies outside its bounds")

    def _correlations(self, table, names):
        ledger = self.ledger
        for name in names:
            ledger.claim_column("coefficients.csv", name, "consistent")
        matrix = table[names].to_numpy(float)
        if np.isfinite(matrix).all():
            if not np.allclose(matrix, matrix.T, rtol=1e-7, atol=1e-9):
                ledger.find("coefficients.csv", "correlations are not symmetric")
            if (
                not np.allclose(np.diag(matrix), 1.0, atol=1e-8)
                or (np.abs(matrix) > 1 + 1e-8).any()
            ):
                ledger.find("coefficients.csv", "correlations are none")

    # What was matched

    def residuals(self):
        """residuals.csv: differences, and the objective and misfits that they make."""
        ledger, table, result = self.ledger, self.matched, self.result
        file = "residuals.csv"
        ledger.column(file, "difference", (table["modelled"] - table["measured"]).to_numpy(),
                      rel=1e-8, abs=2e-8 * float(table["measured"].abs().max()))  # fmt: skip
        ledger.claim_column(file, "modelled", "consistent")
        blocks, names = {}, []
        for (test, part), own in table.groupby(["test", "part"], sort=False):
            is_whole = self._is_bubble(test) or self.kind_of(test)[0] == "tube"
            name = test if is_whole else f"{test}: {part}"
            names.append(name)
            blocks[name] = own
            rms = float(np.sqrt(np.mean(own["difference"] ** 2)))
            units = own["unit"].unique()
            if len(units) != 1:
                ledger.find(f"{file}: {name}", f"has the units {units}")
            misfit = result["misfit"].get(name)
            if misfit is None:
                ledger.find(f"result.json: misfit.{name}", "is missing")
                continue
            place = ("misfit", name)
            ledger.json((*place, "unit"), units[0])
            ledger.json((*place, "rms"), rms, rel=1e-6)
            noise = misfit["noise"]
            ratio = misfit["rms"] / noise if noise > 0 else None
            ledger.json((*place, "times_noise"), ratio, rel=1e-9)
            measured = float(np.sqrt(np.mean(own["measured"] ** 2)))
            ledger.json((*place, "share"), rms / measured if measured > 0 else 0.0, rel=1e-6)
        if set(result["misfit"]) != set(names):
            ledger.find("result.json: misfit", f"is of {sorted(result['misfit'])}")
        self.blocks = blocks
        self._noise()

    def _is_bubble(self, test):
        return "mean_abs_mm" in self.result["tests"][test]

    def kind_of(self, test):
        """Return the section of the project that a test is of, and the test's table."""
        project, numbers = self.folder.project, {}
        for kind in ("bubble", "strips", "biaxial", "cycles", "cylinder", "bending", "tube"):
            own = project.get(kind, [])
            for k, section in enumerate(own):
                default = kind if len(own) == 1 else f"{kind}-{k + 1}"
                numbers[section.get("name", default)] = (kind, section)
        return numbers.get(test, (None, {}))

    def _notes_of_misfits(self):
        """Sentences on a misfit of many times the noise: RMS, its multiple, the noise."""

        def expected(match):
            for misfit in self.result["misfit"].values():
                if f"{misfit['rms']:.3g} {misfit['unit']}" == f"{match[1]} {match[2]}":
                    return misfit["rms"], None, misfit["rms"] / misfit["noise"], misfit["noise"]
            return None

        pattern = rf"the fit leaves {NUM} (\w+) RMS, {NUM} times the noise \({NUM} \w+, \D*\)"
        self.ledger.text(pattern, expected, digits=3, needed=False)

    def _noise(self):
        """Noise: the project's, the scatter of specimens, or usual for such an instrument."""
        ledger, result = self.ledger, self.result
        self._notes_of_misfits()
        for name, misfit in result["misfit"].items():
            test = name.partition(":")[0]
            kind, section = self.kind_of(test)
            expected = "given" if "noise" in section else None
            if expected and misfit["noise_is"] != expected:
                ledger.find(f"result.json: misfit.{name}.noise_is", f"is {misfit['noise_is']!r}")
            place = ("misfit", name, "noise")
            if misfit["noise_is"] == "given":
                ledger.json(place, section.get("noise"), "echoed", rel=1e-12)
            elif kind == "bubble":
                ledger.json(place, 0.05, "echoed")
            elif kind == "strips" and misfit["noise_is"] == "assumed":
                largest = float(self.blocks[name]["measured"].abs().max())
                ledger.json(place, 0.005 * largest, rel=1e-8)
            elif kind == "strips":
                direction = name.partition(": ")[2]
                scatter = result["tests"][test]["directions"][direction]["scatter_N"]
                ledger.json(place, scatter, "consistent", rel=1e-12)
            else:
                ledger.claim_json(place, "consistent")
        self._given_noise()

    def _given_noise(self):
        """Chi-square of each residual against the noise that the project gives, and its note."""
        ledger, result = self.ledger, self.result
        tests = result.get("noise_given", {})
        given = [n for n, m in result["misfit"].items() if m["noise_is"] == "given"]
        if sorted(tests) != sorted(given):
            ledger.find("result.json: noise_given", f"is of {sorted(tests)}; expected {given}")
        if not tests:
            return
        shares = []
        for name in given:
            own, misfit, place = tests[name], result["misfit"][name], ("noise_given", name)
            ledger.json((*place, "values"), len(self.blocks[name]))
            if not 1.0 <= own["independent"] <= own["values"] * (1 + 1e-9):
                ledger.find(f"result.json: noise_given.{name}.independent",
                            f"is {own['independent']} of {own['values']} values")  # fmt: skip
            for key in ("independent", "degrees_of_freedom"):
                ledger.claim_json((*place, key), "consistent")
            if not 1.0 <= own["degrees_of_freedom"] <= max(own["independent"], 1.0):
                ledger.find(f"result.json: noise_given.{name}.degrees_of_freedom",
                            f"is {own['degrees_of_freedom']:.5g}")  # fmt: skip
            elif own["degrees_of_freedom"] > 1.0:
                shares.append(own["degrees_of_freedom"] / own["independent"])
            square = own["independent"] * (misfit["rms"] / misfit["noise"]) ** 2
            ledger.json((*place, "chi_square"), square)
            among = chi2(own["degrees_of_freedom"])
            more, less = float(among.sf(square)), float(among.cdf(square))
            ledger.json((*place, "probability_of_more"), more, rel=1e-4, abs=1e-12)
            ledger.json((*place, "probability_of_less"), less, rel=1e-4, abs=1e-12)
            ratio = misfit["times_noise"] / np.sqrt(own["degrees_of_freedom"] / own["independent"])
            kinds = {n["kind"] for n in result["notes"] if n["of"] == name}
            for kind, expected in (
                ("above the noise", more < 0.01 and ratio > 1.1),
                ("below the noise", less < 0.01 and ratio < 0.9),
            ):
                if (kind in kinds) != expected:
                    ledger.find(f"notes: {name}", f"{kind!r} is {kind in kinds}")
        if shares and np.ptp(shares) > 1e-6:
            ledger.find("result.json: noise_given", f"unknowns take the shares {shares}")
        named = {tuple(self._numbers_of_noise(name)): name for name in given}

        def numbers(match):
            return list(match.groups()) if match.groups() in named else named_first

        named_first = next(iter(named))
        ledger.text(
            rf"the fit leaves {NUM} \S+ RMS, {NUM} times the noise given \({NUM} \S+; (\d+) values "
            rf"count as {NUM} independent ones\)",
            numbers,
            needed=False,
        )

    def _numbers_of_noise(self, name):
        """Return the numbers of the note on a given noise, as printed."""
        misfit, own = self.result["misfit"][name], self.result["noise_given"][name]
        printed = (misfit["rms"], misfit["times_noise"], misfit["noise"])
        return (*(f"{value:.3g}" for value in printed), str(own["values"]),
                f"{own['independent']:.3g}")  # fmt: skip

    # How it was found

    def starts(self):
        """Starts: starts.jsonl, history.csv and result.json count the same."""
        folder, ledger, result = self.folder, self.ledger, self.result
        records = folder.starts
        ended = [r for r in records if r["objective"] is not None]
        self.best_start = min(ended, key=lambda r: r["objective"], default=None)
        for record in records:
            k = record["number"]
            own = ("starts", k)
            for key, name in (("start", "number"), ("analyses", "analyses"),
                              ("external_runs", "external_runs")):  # fmt: skip
                ledger.json((*own, key), record[name], "consistent")
            # The best start runs once more from the unloaded state.
            near = {"rel": 1e-4, "abs": 1e-9} if record is self.best_start else {"rel": 1e-12}
            ledger.json((*own, "objective"), record["objective"], "consistent", **near)
            ledger.json((*own, "status"), record["status"])
            ledger.json((*own, "cached_runs"), record.get("cached_runs", 0), "consistent")
            seed = record["seed"]
            if seed != [result["seed"], record["number"]]:
                ledger.find(f"starts.jsonl: {k}", f"has the seed {seed}")
        for k, record in enumerate(records):
            for key in record:
                ledger.claim_json((k, key), "consistent", file="starts.jsonl")
        if len(result["starts"]) != len(records):
            ledger.find("result.json: starts", f"are {len(result['starts'])} of {len(records)}")
        for key in ("analyses", "external_runs", "cached_runs"):
            total = sum(record.get(key, 0) for record in records)
            ledger.json(key, total, "recomputed")
        objectives = [r["objective"] for r in records if r["objective"] is not None]
        self.objectives = sorted(objectives)
        coarse = result.get("coarse_to_fine")
        if coarse is None:
            ledger.json("coarse_to_fine", None)
        if objectives:
            # The best start runs once more from the unloaded state.
            ledger.json("objective", min(objectives), "consistent", rel=1e-4, abs=1e-9)
        self._objective()
        self._history(records)
        self._agreement()

    def _objective(self):
        """The objective from the residuals: RMS of each block, relative, weighted."""
        ledger, result = self.ledger, self.result
        errors = {}
        weights = {}
        for test in result["tests"]:
            kind, section = self.kind_of(test)
            weights[test] = float(section.get("weight", 1.0))
            if kind in KINDS:
                errors[test] = KINDS[kind].objective(self, test, section)
        if any(error is None for error in errors.values()) or len(errors) < len(result["tests"]):
            return
        if self.several:
            total = sum(weights[test] * errors[test] for test in errors)
            ledger.json("objective", total, rel=1e-6)
            ledger.json("mean_relative_error", errors, rel=1e-6)
            ledger.json("weights", weights, "echoed")
        else:
            (error,) = errors.values()
            ledger.json("objective", error, rel=1e-6)

    def _history(self, records):
        """history.csv: a row an analysis; the best objective of each start."""
        ledger, folder = self.ledger, self.folder
        file = "history.csv"
        if file not in folder.tables:
            return
        table = folder.data(file)
        for record in records:
            number = record["number"]
            own = table[table["start"] == number]
            count = record["analyses"] + (record.get("coarse_analyses") or 0)
            if len(own) not in (record["analyses"], count):
                ledger.find(f"{file}: start {number}", f"has {len(own)} rows of {count} analyses")
            steps = own["analysis"].to_numpy()
            if not np.array_equal(steps, np.arange(1, len(own) + 1)):
                ledger.find(f"{file}: start {number}", "analyses are not numbered from 1")
            full = own[own["mesh"] == "full"] if "mesh" in own else own
            values = full["objective"].to_numpy(float)
            if np.isfinite(values).any() and record["objective"] is not None:
                if np.nanmin(values) > record["objective"] * (1 + 1e-6) + 1e-12:
                    ledger.find(f"{file}: start {number}", "no analysis has the start's objective")
            external = int((own["solver"] != "membrane").sum())
            if external != record["external_runs"] + record.get("cached_runs", 0):
                if self.result["solver"] != "membrane":
                    ledger.find(f"{file}: start {number}", f"has {external} external runs")
        for column in table:
            ledger.claim_column(file, column, "consistent")

    def _agreement(self):
        """How many starts ended in the best optimum."""
        words = self.result["optima"]
        count = len(self.objectives)
        if not words:
            if count > 1:
                self.ledger.find("result.json: optima", f"says nothing of {count} starts")
            return
        groups = self._optima()
        best = next(group for group in groups if self.best_start in group)
        good = self.objectives[0] * (1 + AS_GOOD) + self.tolerance
        near = sum(
            record in best or record["objective"] <= good
            for record in self.folder.starts
            if record["objective"] is not None
        )

        def expected(match):
            all_of, _, _ = match.groups()
            if all_of is not None:
                if near != count:
                    self.ledger.find("result.json: optima", f"{near} of {count} are alike")
                return [count, None, None]
            return [None, near, count]

        self.ledger.text(
            r"(?:all (\d+)|(\d+) of (\d+)) starts(?: \([^)]*\))? end in the",
            expected,
            "recomputed",
            needed=False,
        )
        self.ledger.text(
            rf"only one of (\d+) starts(?: \([^)]*\))? end in the best of .*\(objective {NUM}, "
            rf"the next {NUM}\).*--starts (\d+)",
            [count, *self.objectives[:2], 5 * count],
            "recomputed",
            needed=False,
        )
        self.ledger.text(r"(\d+) distinct optima", [len(groups)], "recomputed", needed=False)

    @property
    def tolerance(self):
        return self.folder.project.get("fit", {}).get("tolerance", 1e-7)

    def _optima(self):
        """Return starts by optimum: objectives within the tolerance and 1 %, moduli within 2 %."""
        groups = []
        for start in sorted(self.folder.starts, key=lambda r: r["number"]):
            if start["objective"] is None:
                continue
            for group in groups:
                if self._alike(group[0], start):
                    group.append(start)
                    break
            else:
                groups.append([start])
        return groups

    def _alike(self, one, other):
        limit = self.tolerance + SAME_OBJECTIVE * min(one["objective"], other["objective"])
        if abs(one["objective"] - other["objective"]) > limit:
            return False
        if "coefficients" not in one:  # a report from Python
            return True
        card, scale = self.card, 1.0 / self.card.mpa
        for k, name in enumerate(MODULI):
            end = max(one["reached"][k], other["reached"][k])
            strain = np.linspace(0.0, min(end, self.ranges[k]), 31)
            a, b = (
                card.modulus_beyond(name, strain, scale * np.array(r["coefficients"]))
                for r in (one, other)
            )
            if np.abs(a / b - 1.0).max() > SAME_MODULI:
                return False
        return True

    # How certain it is

    def uncertainty(self):
        """The summary of moduli.csv in result.json, and the noise that it counts."""
        ledger, result = self.ledger, self.result
        sure = result.get("uncertainty")
        if sure is None:
            return
        for name, misfit in result["misfit"].items():
            place, largest = ("uncertainty", "noise", name), max(misfit["rms"], misfit["noise"])
            if self.kind_of(name.partition(":")[0])[0] == "biaxial":
                # Less what noise of the first row explains.
                ledger.claim_json(place, "consistent")
                if not misfit["noise"] <= sure["noise"][name] <= 1.05 * largest:
                    ledger.find(f"result.json: uncertainty.noise.{name}", "is not that of the rows")
            else:
                rel = 0.05 if sure["largest_relative_mesh"] else 1e-6
                ledger.json(place, largest, rel=rel)
            alike = sure["values_that_err_as_one"][name]
            count = len(self.blocks[name])
            self._alike_values(name, misfit, count)
            if not 1.0 - 1e-9 <= alike <= count * (1 + 1e-9):
                ledger.find(f"result.json: values_that_err_as_one.{name}", f"is {alike} of {count}")
        for name in MODULI:
            own = self.table[self.table["modulus"] == name]
            columns = {
                "largest_relative_sigma": own["sigma_relative"].max(),
                "median_relative_sigma": own["sigma_relative"].median(),
                "largest_relative_noise": own["noise_relative"].max(),
                "largest_relative_mesh": own["mesh_relative"].abs().max(),
            }
            for key, value in columns.items():
                if sure[key] is not None:
                    ledger.json(("uncertainty", key, name), float(value), "recomputed",
                                rel=1e-6, abs=1e-12)  # fmt: skip
        self._second_order(sure["second_order"])
        self._discrepancies(sure)
        self._pinned(sure)

    def _alike_values(self, name, misfit, count):
        """Readings of a strip's curve that vary together; of a misfit within the noise, exactly.

        Without specimens to compare there are 1.25 independent places along a curve.
        """
        place = ("uncertainty", "values_that_err_as_one", name)
        test, _, part = name.partition(": ")
        kind, section = self.kind_of(test)
        expected = None
        if kind == "bubble" or misfit["noise_is"] == "given":
            expected = 1.0
        elif kind == "strips":
            expected = strips.alike(self, test, section, part, count)
        within = misfit["rms"] <= misfit["noise"] * 0.999
        if expected is not None and within and "specimens" not in section.get("data", {}):
            self.ledger.json(place, expected, rel=1e-6)
        else:
            self.ledger.claim_json(place, "consistent")

    def _second_order(self, order):
        """The order of the uncertainty, and the sentence on what it changes."""
        if order is None:
            return
        ledger = self.ledger
        place = ("uncertainty", "second_order")
        ledger.claim_json(place, "consistent")
        ledger.json((*place, "order"), 1 if order["why"] else 2, "recomputed")
        if order["analyses"] < 0 or order["directions"] > 8:
            ledger.find("result.json: uncertainty.second_order", f"is {order}")
        changes = order["change_of_sigma"]
        largest = max(map(abs, changes.values()), default=0.0)
        if order["order"] == 2 and largest <= 0.1:
            ledger.find("result.json: uncertainty.second_order", f"changes only {largest:.2g}")
        each = ", ".join(rf"{name} ([-+]\d+) %" for name in changes)
        told = [f"{100 * by:+.0f}" for by in changes.values()]
        ledger.text(
            rf"(?:second order: 1 sigma against that of the first derivatives:|the second would "
            rf"change 1 sigma by) {each}",
            told,
            needed=order["order"] == 2,
        )

    def _discrepancies(self, sure):
        """What noise does not explain of a residual is not more than the residual."""
        for name, own in sure["smooth_beyond_noise"].items():
            place = ("uncertainty", "smooth_beyond_noise", name)
            self.ledger.claim_json(place, "consistent")
            misfit = self.result["misfit"][name]
            self.ledger.json((*place, "unit"), misfit["unit"])
            rows = self.blocks[name]
            size = float(np.sqrt(np.mean(rows["measured"] ** 2)))
            self.ledger.json((*place, "share"), own["rms"] / size, "recomputed", rel=0.02)
            if own["rms"] > 2 * misfit["rms"] + 1e-3 * misfit["noise"] and not self.mesh_in_it:
                self.ledger.find(f"result.json: {'.'.join(place)}.rms", f"is {own['rms']}")
            self._causes(own)
            self._note_of_discrepancy(name, own)
            shares = [cause["share"] for cause in own["causes"]]
            if any(not 0 <= share <= 1 + 1e-9 for share in shares) or (
                shares != sorted(shares, reverse=True)
            ):
                self.ledger.find(f"result.json: {'.'.join(place)}.causes", f"have shares {shares}")

    def _note_of_discrepancy(self, name, own):
        """The note on it has its numbers; there is one where it is told."""
        of, quantity = (
            (r"alike in all (\d+) specimens \(Hotelling's F is", "loads")
            if own["specimens"]
            else (r"smooth over the whole sheet()() ?\(", "displacements")
        )
        pattern = (
            rf"{NUM} {own['unit']} of what the fit leaves, {NUM} % of the {quantity}, is "
            rf"{of.replace('()()', '()')} ?{NUM}[^;]*; chance gives {NUM} in one of a hundred\)"
        )
        numbers = [own["rms"], None, str(own["specimens"] or ""), own["ratio"], own["largest"]]

        def expected(match):
            share = 100 * own["share"]
            if abs(as_number(match[2]) - share) > 0.06 * max(share, 1e-3):
                self.ledger.find(f"notes: {name}", f"{match[0]!r}: the share is {share:.3g} %")
            numbers[1] = match[2]
            return numbers

        kinds = ("wrong form", "cause of the misfit")
        told = [n for n in self.result["notes"] if n["kind"] in kinds
                and n["of"] in (name, "", name.partition(": ")[2])]  # fmt: skip
        if own["told"] and not told:
            self.ledger.find(f"notes: {name}", "say nothing of a discrepancy that is told")
        if own["told"]:
            self.ledger.text(pattern, expected, digits=[2, 3, 3, 3, 3])
        if own["causes"]:
            most = max(cause["share"] for cause in own["causes"])
            self.ledger.text(r"known causes explain at most (\d+) %", [f"{100 * most:.0f}"],
                             needed=False)  # fmt: skip
        for cause in own["causes"]:
            self.ledger.text(
                rf"{re.escape(cause['words'])} \((\d+) % of it explained; moduli would[^)]*\)",
                lambda m, cause=cause: self._cause(m, cause), needed=False,
            )  # fmt: skip

    def _cause(self, match, cause):
        if match[1] != f"{100 * cause['share']:.0f}":
            self.ledger.find("notes", f"{match[0]!r}: the share is {cause['share']:.3g}")
        for text in self.ledger.texts:
            at = text.text.find(match[0])
            if at >= 0:
                text.claim((at, at + len(match[0])), "consistent")
        return [match[1]]

    def _causes(self, own):
        """Amounts of causes stand alike in result.json and in the note."""
        for cause in own["causes"]:
            amount = re.search(NUM, cause["words"])
            if amount is None:
                continue
            for text in self.ledger.texts:
                at = text.text.find(cause["words"])
                if at >= 0:
                    text.claim((at, at + len(cause["words"])), "consistent")

    @property
    def mesh_in_it(self):
        """Whether the residual of ever finer meshes is another than that of residuals.csv."""
        return bool(self.result["uncertainty"]["largest_relative_mesh"])

    def _pinned(self, sure):
        """What each test determines: less than all together, at most the prior."""
        ledger, result = self.ledger, self.result
        pinned = result.get("pinned", {})
        together = pinned.get("all together", {})
        for name, own in together.items():
            ledger.json(("pinned", "all together", name, "median"),
                        sure["median_relative_sigma"][name], "consistent")  # fmt: skip
            ledger.json(("pinned", "all together", name, "largest"),
                        sure["largest_relative_sigma"][name], "consistent")  # fmt: skip
            table = self.table[self.table["modulus"] == name]
            ledger.json(("pinned", "all together", name, "least"),
                        float(table["sigma_relative"].min()), "recomputed", abs=1e-12)  # fmt: skip
            share = 1.0 - self.determined[self.table["modulus"] == name].mean()
            ledger.json(("pinned", "all together", name, "not_determined"), float(share),
                        "recomputed", abs=1e-12)  # fmt: skip
            for source in pinned:
                alone = pinned[source][name]
                ledger.claim_json(("pinned", source, name), "consistent")
                drawn = self.pinned_charts.get((source, name))
                if drawn is not None:
                    lost = np.isnan(drawn)
                    ledger.json(("pinned", source, name, "not_determined"), float(lost.mean()),
                                "consistent", abs=1e-9)  # fmt: skip
                    ends = {"least": np.min, "median": np.median, "largest": np.max}
                    for key, of in ends.items() if not lost.any() else ():
                        ledger.json(("pinned", source, name, key), float(of(drawn)), "consistent",
                                    rel=1e-5)  # fmt: skip
                if not 0 <= alone["least"] <= alone["median"] <= alone["largest"]:
                    ledger.find(f"result.json: pinned.{source}.{name}", f"is not sorted: {alone}")
                if not 0 <= alone["not_determined"] <= 1:
                    ledger.find(f"result.json: pinned.{source}.{name}", "has no share of strains")
                if alone["largest"] >= LARGEST_SIGMA and not alone["not_determined"]:
                    ledger.find(f"result.json: pinned.{source}.{name}", "is determined nowhere")
                if alone["median"] < 0.9 * own["median"]:
                    ledger.find(f"result.json: pinned.{source}.{name}", "one knows more than all")
            self._stretched_ones_know(name, pinned)
            if self.card.form == "constant":
                self._precisions_add(name, pinned)

    def _stretched_ones_know(self, name, pinned):
        """Strips along a yarn, or on the bias, determine its modulus better than tests without."""
        direction = {"E1": "warp", "E2": "fill", "G12": "bias"}[name]
        medians = {True: [], False: []}
        for source, own in pinned.items():
            kind, section = self.kind_of(source)
            # Yarns that are only pulled by the contraction of a strip on the bias know a little.
            if kind == "strips" and (direction in section or "bias" not in section):
                medians[direction in section].append(own[name]["median"])
        if max(medians[True], default=0.0) > min(medians[False], default=np.inf):
            self.ledger.find(
                f"result.json: pinned of {name}", f"a test without {direction} strips knows more"
            )

    @property
    def pinned_charts(self):
        """Return what is drawn of each test's sigma, by test and modulus, as fractions."""
        drawn = {}
        for part in self.folder.charts("pinned"):
            for chart in part["charts"]:
                name = chart["title"].partition(",")[0]
                for series in chart["series"]:
                    drawn[series["name"], name] = np.array(series["y"], dtype=float) / 100
        return drawn

    def _precisions_add(self, name, pinned):
        """Of constants that hardly correlate, the tests' precisions add, the prior counted once."""
        total = sum(
            own[name]["median"] ** -2 - PRIOR**-2 for source, own in pinned.items()
            if source != "all together" and not own[name]["not_determined"]
        )  # fmt: skip
        expected = (total + PRIOR**-2) ** -0.5
        told = pinned["all together"][name]["median"]
        if expected < told * 0.8:
            self.ledger.find(
                f"result.json: pinned of {name}", f"alone they make {expected:.4g}, not {told:.4g}"
            )

    def verdict(self):
        """Where each modulus is usable, and not known, by its band in moduli.csv."""
        ledger = self.ledger
        ledger.json(("verdict", "within"), USABLE, "echoed")
        for name in MODULI:
            own = self.table[self.table["modulus"] == name]
            value, end = own["MPa"], self.card.ends[name]
            off = np.maximum(own["upper_MPa"] - value, value - own["lower_MPa"]) / value
            strain = own["strain"].to_numpy()
            known = off.notna().any()
            determined = self.determined[self.table["modulus"] == name]
            usable = (off <= USABLE).to_numpy() & determined & ~self._on_bound(own)
            spans = {
                "usable": _longest(strain, usable) if known else None,
                "not_known": _longest(strain, ~determined) if known else [0, end],
            }
            for key, span in spans.items():
                ledger.json(("verdict", "moduli", name, key), span, rel=1e-6, abs=1e-12)
        self._state()
        self._verdict_words()

    def _state(self):
        """The state and its reasons follow from the notes and from where moduli are usable."""
        ledger, verdict = self.ledger, self.result["verdict"]
        kinds = {note["kind"] for note in self.result["notes"]}
        unusable = [words for kind, words in UNUSABLE.items() if kind in kinds]
        doubtful = {words for kind, words in AGAINST.items() if kind in kinds}
        if "above the noise" in kinds:
            words, is_large = self._largest_misfit()
            (unusable.append if is_large else doubtful.add)(words)
        reasons, known = verdict["reasons"], "uncertainty" in self.result
        usable = [own["usable"] for own in verdict["moduli"].values() if own["usable"]]
        expected = [*unusable, *doubtful]
        if not known:
            expected.append(NO_CERTAINTY)
        elif not unusable and not usable:
            expected.append(NOTHING_USABLE)
        if sorted(reasons) != sorted(expected):
            ledger.find("result.json: verdict.reasons", f"are {reasons}; expected {expected}")
        if set(reasons[: len(unusable)]) != set(unusable):
            ledger.find("result.json: verdict.reasons", "do not begin with what makes it unusable")
        state = "usable within limits" if expected else "usable"
        if unusable or (known and not usable):
            state = "not to be used"
        if verdict["state"] != state and not (
            state == "usable" and verdict["state"] == "usable within limits" and self._is_short()
        ):
            ledger.find("result.json: verdict.state", f"is {verdict['state']!r}; expected {state}")
        for reason in reasons:
            ledger.text(rf"{re.escape(reason)}", [], needed=False)

    def _largest_misfit(self):
        """Words of the verdict on the largest misfit above the noise; whether it is too large."""
        misfits = self.result["misfit"].items()
        above = {name: misfit for name, misfit in misfits if (misfit["times_noise"] or 9e9) > 1}
        name, misfit = max(above.items(), key=lambda item: item[1]["share"])
        if not misfit["share"]:
            return "the fit leaves more than the noise of the data", False
        values = {"N": "loads", "mm": "displacements"}.get(misfit["unit"], "values")
        words = f"the fit is off by {percent(misfit['share'])} of the {values} of {name} (RMS), "
        return f"{words}{misfit['times_noise']:.3g} times their noise", misfit["share"] > USABLE

    def _is_short(self):
        """Whether a modulus that a test reached is not usable up to nearly its end."""
        for name, own in self.result["verdict"]["moduli"].items():
            end = self.card.ends[name]
            if end >= 1e-4 and (
                own["usable"] is None or own["usable"][0] > 0 or own["usable"][1] < 0.95 * end
            ):
                return True
        return False

    def _verdict_words(self):
        """The sentences of result.json, page and terminal follow from where moduli are usable."""
        ledger, moduli = self.ledger, self.result["verdict"]["moduli"]

        def spans(key):
            words = []
            for name in MODULI:
                span, end = moduli[name][key], self.card.ends[name]
                if span is None:
                    if key == "usable":
                        words.append(f"{name} at no strain")
                elif end < 1e-4:
                    words.append(f"{name} at any strain")
                else:
                    low, high = (f"{100 * v:.2g}" for v in span)
                    between = f"from {low} to {high}" if span[0] > 0 else f"up to {high}"
                    words.append(f"{name} {between} % strain")
            return words

        verdict = self.result["verdict"]
        reasons = "; ".join(verdict["reasons"])
        if verdict["state"] == "not to be used":
            sentence, unknown, against = reasons, "", ""
        else:
            first, *rest = spans("usable")
            name, _, span = first.partition(" ")
            sentence = ", ".join([f"{name} is known to ±20 % {span}", *rest])
            if "uncertainty" not in self.result:
                sentence = "the moduli have no bands"
            unknown = "; ".join(
                [*filter(None, [", ".join(spans("not_known"))]),
                 "any modulus beyond the strains that the tests reach"]
            )  # fmt: skip
            against = reasons
        expected = {"sentence": sentence, "not_known": unknown}
        for key, words in expected.items():
            if verdict[key].replace("\u00a0", " ") != words:
                ledger.find(
                    f"result.json: verdict.{key}", f"is {verdict[key]!r}; expected {words!r}"
                )
        details = {"Against it": against, "Not known": unknown, "Next": verdict["next"]}
        title = verdict["state"].capitalize()
        shown = {"page": ledger.folder.page, "terminal": ledger.printed}
        for source in [name for name, content in shown.items() if content]:
            lines = {title: sentence, **details}
            for label, words in lines.items():
                plain = f"{label}: {words}." if source == "terminal" else f"{words}."
                texts = [t for t in ledger.texts if t.source == source]
                if words and not any(t.text.replace("\u00a0", " ") == plain for t in texts):
                    ledger.find(f"{source}: verdict", f"does not say {plain!r}")
        for words in (sentence, unknown):
            if words:
                claim_literal(ledger, words, "recomputed")
        if self.folder.page is not None and not any(
            tag == "p" and text == title for tag, _, text in self.folder.page.sentences
        ):
            ledger.find("page", f"has no verdict {title!r}")

    def unknowns(self):
        """Unknowns beside the moduli: numbers, words and the page's table."""
        ledger = self.ledger
        rows = []
        for name, own in self.result.get("unknowns", {}).items():
            place = ("unknowns", name)
            ledger.claim_json(place, "consistent")
            low, high = own["bounds"]
            value, sigma, prior = own["value"], own["sigma"], own["prior"]
            room = 1e-6 * (high - low)
            if not low - room <= value <= high + room:
                ledger.find(f"result.json: unknowns.{name}", f"{value} lies outside its bounds")
            on = None
            if value - low <= 1e-6 * (high - low):
                on = "lower"
            elif high - value <= 1e-6 * (high - low):
                on = "upper"
            ledger.json((*place, "on_bound"), on)
            known = 0.9 * prior if prior is not None else (high - low) / math.sqrt(12.0)
            ledger.json((*place, "determined"), sigma < known)
            for modulus, rho in own["correlation"].items():
                if not abs(rho) <= 1 + 1e-9:
                    ledger.find(f"result.json: unknowns.{name}.correlation.{modulus}", f"is {rho}")
            self._correlation_in_the_middle(name, own)
            self._words_of_unknown(name, own)
            unit = own["unit"]
            told = own["sigma"] if own["determined"] else "not determined"
            rows.append([name, unit, value, told, low, high, prior, own["verdict"]])
        if rows and self.folder.page is not None:
            ledger.table("Unknowns beside the moduli", None, rows)

    def _correlation_in_the_middle(self, name, own):
        """Its correlation with each modulus at half of the valid strains, from coefficients.csv."""
        table = self.folder.data("coefficients.csv")
        size = len(self.card.labels)
        sigma = table["sigma"].to_numpy(float)[:size]
        matrix = table[list(self.card.labels)].to_numpy(float)
        row = table["unknown"].tolist().index(name)
        covariance = matrix[:size] * np.outer(sigma, sigma)
        for modulus, rho in own["correlation"].items():
            slope = self.card.rows(modulus, 0.5 * self.card.ends[modulus])[0, self.card.free]
            spread = math.sqrt(max(slope @ covariance @ slope, 0.0))
            expected = float(slope @ (matrix[row] * sigma)) / max(spread, 1e-300)
            if abs(expected - rho) > 0.02:
                self.ledger.find(
                    f"result.json: unknowns.{name}.correlation.{modulus}",
                    f"is {rho:.3f}; coefficients.csv gives {expected:.3f}",
                )

    def _words_of_unknown(self, name, own):
        """The sentence on an unknown has its numbers."""
        ledger, words = self.ledger, own["verdict"]
        unit = f" {own['unit']}" if own["unit"] else ""
        begin = f"{own['value']:.4g}{unit}"
        if own["on_bound"]:
            begin += f", on its {own['on_bound']} bound"
        if own["determined"]:
            begin += f", 1 sigma {own['sigma']:.2g}{unit}"
            modulus, rho = max(own["correlation"].items(), key=lambda item: abs(item[1]))
            if abs(rho) >= 0.5:
                begin += f", correlation {rho:.2f} with {modulus}"
        else:
            begin += ": the data say nothing of it ("
            if own["prior"] is not None:
                begin += f"known to {own['prior']:.2g}{unit} before)"
            else:
                low, high = own["bounds"]
                begin += f"it may be {low:.4g} to {high:.4g}{unit})"
        if not words.startswith(begin):
            ledger.find(
                f"result.json: unknowns.{name}.verdict", f"is {words!r}; expected {begin!r}"
            )
        for text in ledger.texts:
            if words in text.text or text.text == words:
                at = text.text.find(words)
                text.claim((at, at + len(words)), "consistent")

    # The page

    def page(self):
        if self.folder.page is None:
            return
        self._answers()
        self._trust()
        self._determined()
        self._found()

    def _answers(self):
        """The answer: moduli and bands at few strains, MPa and kN/m."""
        ledger, card, table = self.ledger, self.card, self.table
        for name in MODULI:
            end = card.ends[name]
            own = table[table["modulus"] == name]
            rows = []
            for k, strain in enumerate([*(s for s in STRAINS if s < 0.95 * end), end]):
                value = float(card.modulus(name, strain))
                band = [float(np.interp(strain, own["strain"], own[c]))
                        for c in ("lower_MPa", "upper_MPa")]  # fmt: skip
                self._reported(("reported", name, k), strain, value, band)
                if 0.0 < strain < 1e-4:
                    continue
                _, *at_bounds = self.determined_at(name, strain)
                cells = [
                    _banded([scale * v for v in (value, *band)], at_bounds)
                    for scale in (1.0, card.thickness)
                ]
                label = f"{100 * strain:.2g} %{', its end' if strain == end else ''}"
                rows.append([label, *cells])
            # Between the fit's strains the band is interpolated: its last digit may differ.
            ledger.table(WORDS[name], ["strain", "MPa", "kN/m"], rows, "recomputed", digits=3,
                         slack=1e-5)  # fmt: skip
            self._drawn_modulus(name)
            rest = float(card.modulus(name, 0.0)), float(card.modulus(name, end))
            ledger.text(rf"^{name}, [^:]*: from {NUM} MPa at rest to {NUM} MPa at {NUM} %",
                        [*rest, 100 * end], digits=3)  # fmt: skip
        ledger.text(r"kN/m: MPa times the thickness of (\S+) mm", [card.thickness])
        ledger.text(r"In brackets the (95) % band", ["95"], needed=False)
        ledger.text(r"with their bands \((95) %, noise and mesh together\)", ["95"], needed=False)
        ledger.text(r"What each test pins down.*from (100) % on", ["100"], needed=False)
        ledger.text(r"add strips at 45 degrees", [], needed=False)

    def _drawn_modulus(self, name):
        """The chart of a modulus: the card's curve within the band of moduli.csv."""
        own = self.table[self.table["modulus"] == name]
        for part in self.folder.charts("moduli"):
            for chart in part["charts"]:
                if not chart["title"].startswith(f"{name},") or "MPa" not in chart["y_label"]:
                    continue
                for series in chart["series"]:
                    strain = np.array(series["x"], dtype=float) / 100
                    if series["name"] == "best":
                        right = self.card.modulus(name, strain)
                        if not np.allclose(series["y"], right, rtol=1e-4):
                            self.ledger.find(f"page: chart of {name}", "is not the card's curve")
                    for end in ("lower", "upper"):
                        told = series.get(end)
                        if told:
                            band = np.interp(strain, own["strain"], own[f"{end}_MPa"])
                            if not np.allclose(np.array(told, dtype=float), band, rtol=1e-2):
                                self.ledger.find(f"page: chart of {name}", f"has another {end}")

    def _reported(self, place, strain, value, band):
        """The row of result.json that has the numbers of one of the page's."""
        ledger, name = self.ledger, place[1]
        known, lower, upper = self.determined_at(name, strain)
        ledger.json((*place, "strain"), strain, rel=1e-8, abs=1e-15)
        ledger.json((*place, "MPa"), value, rel=1e-7)
        ledger.json((*place, "kN_per_m"), value * self.card.thickness, rel=1e-7)
        if not np.isfinite(band).all():
            return
        own = self.table[self.table["modulus"] == name]
        sigma = float(np.interp(strain, own["strain"], own["sigma_relative"]))
        ledger.json((*place, "sigma"), sigma, "consistent", rel=5e-3)
        ledger.json((*place, "band"), band, "consistent", rel=1e-6)
        ledger.json((*place, "at_lower_bound"), bool(lower))
        ledger.json((*place, "at_upper_bound"), bool(upper))
        ledger.json((*place, "determined"), bool(known))

    def _trust(self):
        """Misfit beside noise, errors against a known law, where the moduli end."""
        ledger, result = self.ledger, self.result
        rows = [
            [name, m["rms"], m["noise"], m["unit"], m["noise_is"], m["times_noise"]]
            for name, m in result["misfit"].items()
        ]
        header = ["compared", "RMS residual", "noise", "unit", "noise is", "residual over noise"]
        ledger.table("Residual beside the noise", header, rows)
        rows = [
            [key, 100 * result["valid_strain"][key], 100 * result["strain_reached"][key]]
            for key in DIRECTION.values()
        ]
        header = ["direction", "moduli fitted up to, %", "largest strain reached, %"]
        ledger.table("Where they end", header, rows)
        fixed = "fitted" if "nu12" in self.names_of_unknowns() else "fixed"
        ledger.fact(f"Poisson's ratio nu12 ({fixed})", float(result["nu12"]))
        label = "thickness (fitted)" if "thickness" in self.names_of_unknowns() else "thickness"
        change = self.folder.card_text.get("thickness_change", "constant")
        ledger.fact(label, (rf"(\S+) mm, {change}", self.card.thickness))
        records, best = self.folder.starts, result["objective"]
        ranked = sum(r["objective"] is not None for r in records)
        ledger.text(r"Best of (\d+) starts: objective ([^;\s]+);", [ranked, best], digits=3)

    def _determined(self):
        """What the data determine; coefficients and their bounds."""
        ledger, result = self.ledger, self.result
        sure = result.get("uncertainty")
        if sure is None:
            return
        rows = []
        for name in MODULI:
            mesh = sure["largest_relative_mesh"]
            lost = 1.0 - self.determined[self.table["modulus"] == name].mean()
            rows.append([
                name,
                told(sure["median_relative_sigma"][name], lost > 0.5),
                told(sure["largest_relative_sigma"][name], lost > 0.0),
                told(sure["largest_relative_noise"][name], lost > 0.0),
                "not known" if mesh is None else percent(round(mesh[name], 6)),
            ])  # fmt: skip
        header = ["modulus", "median 1 sigma", "largest 1 sigma", "by noise, largest",
                  "mesh, largest"]  # fmt: skip
        ledger.table("What the data determine", header, rows)
        self._deciding_quantities()
        self._noise_note(sure)
        pinned = result.get("pinned")
        if pinned:
            rows = [
                [source, name, *told_of(own)]
                for source, moduli in pinned.items() for name, own in moduli.items()
            ]  # fmt: skip
            header = ["test", "modulus", "median 1 sigma", "largest 1 sigma"]
            ledger.table("What each test pins down", header, rows)
            ledger.text(r"every modulus is taken to be known to (\d+) %", [int(100 * PRIOR)])
            ledger.text(r"1 sigma of (\d+) % or more", [int(100 * LARGEST_SIGMA)])
            for source, moduli in pinned.items():
                for name, own in moduli.items():
                    words = f"{source} alone does not determine {name} at any strain"
                    said = any(text.text.startswith(words) for text in ledger.texts)
                    if said != (own["not_determined"] == 1.0 and source != "all together"):
                        ledger.find(f"notes: {source}, {name}", "says the wrong of 'alone'")
        ledger.text(r"alone does not determine \w+ at any strain", [], needed=False)

    def _deciding_quantities(self):
        """One quantity alone leaves no less uncertainty of a modulus than all data together.

        All together leave the least of the reported sigmas, as far as its digits tell.
        """
        place = "What the data determine > Which quantity decides which modulus > "
        self.ledger.text(
            r"The smallest 1 sigma that .* unknown: (\d+) % or more at every strain",
            [int(100 * LARGEST_SIGMA)],
            needed=False,
        )
        self.ledger.text(
            r"alone decides each modulus; from (\d+) % on a modulus is not determined",
            [int(100 * LARGEST_SIGMA)],
            needed=False,
        )
        for text in self.ledger.texts:
            if text.source != "page" or not text.place.startswith(place):
                continue
            name = text.place.rpartition(" > ")[2]
            match = re.match(r"([\d.]+(?:e[-+]?\d+)?) %", text.text.replace("\u00a0", " "))
            if name in MODULI and match is not None:
                of_modulus = self.table[self.table["modulus"] == name]
                is_determined = of_modulus["determined"] == "True"
                smallest = 100 * of_modulus["sigma_relative"][is_determined].min()
                is_together = text.place.startswith(f"{place}all together")
                least = 0.9 * smallest
                most = 1.1 * smallest if is_together else np.inf
                if not least <= float(match[1]) <= most:
                    self.ledger.find(f"page: {text.place}", f"{text.text!r}: less than of all data")
                for span in text.claims:
                    text.claims[span] = "consistent"

    def _noise_note(self, sure):
        """The note that lists the noise of every comparison."""
        units = {name: m["unit"] for name, m in self.result["misfit"].items()}

        def listed():
            for name, value in sure["noise"].items():
                alike = sure["values_that_err_as_one"][name]
                together = f", {alike:.2g} neighbouring values err as one" if alike > 1.05 else ""
                yield f"{value:.2g} {units[name]} ({name}{together})"

        expected = f"noise of {', '.join(listed())} on everything matched"
        for text in self.ledger.texts:
            if (
                text.source == "page"
                and text.text.startswith("noise of ")
                and ("on everything matched" in text.text)
            ):
                if not text.text.startswith(expected):
                    self.ledger.find("page: what the data determine", f"notes {text.text!r}")
                text.claim((0, len(expected)), "consistent")
        self.ledger.text(r"1 sigma: half of the band of (68) in 100 draws", ["68"])
        self.ledger.text(r"Uncertainty of (?:first|second) order.*", self._order, needed=False)

    def _order(self, match):
        order = self.result["uncertainty"]["second_order"]
        changes = ", ".join(
            f"{name} {100 * by:+.0f} %" for name, by in order["change_of_sigma"].items()
        )
        if changes not in match[0] and order["why"] != "not positive definite":
            self.ledger.find("page: uncertainty", f"{match[0]!r} is without {changes!r}")
        return []

    def _found(self):
        """How it was found: facts, starts, bounds."""
        ledger, result, folder = self.ledger, self.result, self.folder
        records = folder.starts
        ranked = sum(r["objective"] is not None for r in records)
        ledger.fact(f"objective: {result['objective_is']}", float(result["objective"]))
        ledger.fact("starts", (r"(\d+) feasible of (\d+)", ranked, len(records)))
        ledger.fact("analyses", result["analyses"])
        if result["external_runs"] or result["cached_runs"]:
            ledger.fact(f"of them by {result['solver']}", result["external_runs"])
        if result["cached_runs"]:
            ledger.fact("of them from the cache", result["cached_runs"])
        records = result["starts"]
        order = sorted(
            records, key=lambda r: math.inf if r["objective"] is None else r["objective"]
        )
        rows = [
            [k, r["start"], r["objective"], r["analyses"], r["status"]]
            for k, r in enumerate(order, start=1)
        ]
        header = ["rank", "start", "objective", "analyses", "how it ended"]
        ledger.table("Starts, best first", header, rows)
        ends = [r["objective"] for r in records if r["objective"] is not None]
        if ends:
            said = max(min(ends), 1e-16), max(float(np.median(ends)), 1e-16), max(*ends, 1e-16)
            ledger.text(r"(\d+) starts?(?:, (\d+) without a result)?: best (\S+), median (\S+), "
                        r"worst ([^\s.]\S*?)(?=\.?$)",
                        [len(records), len(records) - ranked, *said], digits=3)  # fmt: skip
        self._tables_of_coefficients()

    def _tables_of_coefficients(self):
        ledger, card = self.ledger, self.card
        table = self.folder.data("coefficients.csv")
        size = len(card.labels)
        unit = self.folder.card_text["unit"]
        rows = [
            [own.unknown, float(own.value), float(own.lower_bound), float(own.upper_bound)]
            for own in table.head(size).itertuples()
        ]
        header = ["coefficient", f"value, {unit}", "lower bound", "upper bound"]
        ledger.table("Coefficients of the law", header, rows, digits=[4, 6, 4, 4])
        if not np.isfinite(table["sigma"].astype(float)).all():
            return
        names = table["unknown"].tolist()
        rows = [
            [own["unknown"], float(own["value"]), float(own["sigma"]), own["unit"],
             *(f"{round(own[name], 2) + 0.0:.2f}" for name in names)]
            for _, own in table.iterrows()
        ]  # fmt: skip
        header = ["unknown", "value", "1 sigma", "unit", *names]
        title = "How sure the coefficients are, and how they hang together"
        ledger.table(title, header, rows)

    # Words

    def _unstable(self):
        """Loads at which equilibria are unstable are those of increments or frames."""
        for test, numbers in self.result["tests"].items():
            for direction in numbers.get("directions", {}):
                prefix = f"{test}-" if self.several else ""
                loads = self.folder.data(f"{prefix}loads.csv")
                own = loads[loads["direction"] == direction]["elongation_mm"]
                self.steps = {*getattr(self, "steps", set()), *(f"{u:.4g}" for u in own)}
        frames = self.matched.get("pressure_kPa")
        if frames is not None:
            self.steps = {*getattr(self, "steps", set()), *(f"{p:.4g}" for p in frames.dropna())}

        def expected(match):
            for number in re.findall(NUM, match[0]):
                if number not in self.steps:
                    self.ledger.find("notes", f"{match[0]!r}: {number} is no load of the model")
            return []

        pattern = rf"unstable equilibri(?:um|a) at {NUM} [^:]*"
        for text in self.ledger.texts:
            for match in re.finditer(pattern, text.text):
                expected(match)
                for span in text.claims:
                    if match.start() <= span[0] < match.end():
                        text.claims[span] = "consistent"

    def _other_notes(self):
        """Analyses used up, the error of the mesh, doubts about the data."""
        ledger, result = self.ledger, self.result
        best = min(
            (r for r in result["starts"] if r["objective"] is not None),
            key=lambda r: r["objective"],
            default=None,
        )
        if best is not None:
            ledger.text(r"the best start used up its (\d+) analyses", [best["analyses"]],
                        needed=False)  # fmt: skip
        failed = [r for r in self.folder.starts if r.get("failure")]
        ledger.text(r"^(\d+) of (\d+) starts ended because", [len(failed), len(result["starts"])],
                    needed=False)  # fmt: skip
        signs = {}
        for name in MODULI:
            own = self.table[self.table["modulus"] == name]["mesh_relative"]
            if own.notna().any():
                signs[name] = own[own.abs().idxmax()]

        def signed(match):
            name, _ = match.groups()
            value = 100 * signs[name]
            digits = 0 if abs(value) >= 10 else 2
            right = f"{value:+.0f}" if digits == 0 else f"{value:+.2g}"
            return [None, right]

        for text in ledger.texts:
            if text.text.find("error of the mesh is taken out of the moduli (") >= 0:
                for match in re.finditer(r"(E1|E2|G12) ([-+][\d.e-]+) %", text.text):
                    right = signed(match)[1]
                    if match[2] != right:
                        ledger.find(f"{text.source}: mesh", f"{match[0]!r}; expected {right} %")
                    text.claim(match.span(2), "consistent")
        self._mesh_notes(signs)
        doubts = [n for n in result["notes"] if n["kind"] in ("doubtful data", "doubt")]
        ledger.text(r"^The data were looked at before the fit \([^)]*\): (\d+) doubts, listed",
                    lambda m: [len(doubts) or m[1]], needed=False)  # fmt: skip
        # What was seen in the data stands alike in all places; `check` is audited for it.
        for note in doubts:
            for text in ledger.texts:
                at = text.text.replace("\u00a0", " ").find(note["note"])
                if at >= 0:
                    text.claim((at, at + len(note["note"])), "consistent")

    def _mesh_notes(self, signs):
        """A modulus on a fine mesh, where the mesh has a larger share than the noise."""

        def expected(match):
            name = match[1] or match[4]
            by, strain = (match[2], match[3]) if match[1] else (match[6], match[5])
            own = self.table[self.table["modulus"] == name]
            at = float(strain) / 100
            mesh = 100 * float(np.interp(at, own["strain"], own["mesh_relative"]))
            noise = 100 * float(np.interp(at, own["strain"], own["noise_relative"]))
            for told, right in ((by, mesh), (match[7], noise)):
                if abs(as_number(told) - right) > 0.06 * abs(right) + 0.05:
                    self.ledger.find("notes: mesh", f"{match[0]!r}: {right:.3g} % by moduli.csv")
            return list(match.groups())

        self.ledger.text(
            rf"(?:on a fine mesh (E1|E2|G12) would be {NUM} % at {NUM} % of strain,|the mesh moved "
            rf"(E1|E2|G12) at {NUM} % of strain: {NUM} % is taken out, and what may be left is) "
            rf"more than the noise makes uncertain \({NUM} %\)",
            expected,
            needed=False,
        )

    def notes(self):
        """Warnings, notes and notes.csv are the same lines; numbers in those of a fit."""
        ledger, result = self.ledger, self.result
        lines = [f"{n['of']}: {n['note']}" if n["of"] else n["note"] for n in result["notes"]]
        if lines != result["warnings"]:
            ledger.find("result.json: warnings", "are not the notes")
        if "notes.csv" in self.folder.tables:
            for key in ("of", "kind", "note"):
                ledger.column("notes.csv", key, np.array([n[key] for n in result["notes"]], object))
        if self.folder.page is not None:
            shown = {text for tag, _, text in self.folder.page.sentences if tag == "li"}
            for line in lines:
                if " ".join(line.split()) not in shown:
                    ledger.find("page: warnings", f"without {line!r}")
        self._unstable()
        self._other_notes()
        reached = {key: 100 * own for key, own in result["strain_reached"].items()}
        limit = dict(zip(DIRECTION.values(), self.ranges, strict=True))

        def beyond(match):
            key, strain, _ = match.groups()
            if as_number(strain) > reached[key] * 1.01:
                ledger.find("notes", f"{match[0]!r}, but {reached[key]:.3g} % is reached at most")
            return [None, None, 100 * limit[key]]

        pattern = (
            r"(warp|fill|shear) strain reached ([\d.]+) %, beyond law.strain_range of ([\d.]+) %"
        )
        if ledger.text(pattern, beyond, digits=3, needed=False):
            ledger.text(r"(?:warp|fill|shear) strain reached ([\d.]+) %",
                        lambda m: [m[1]], needed=False)  # fmt: skip
        for name in MODULI:
            own = self.table[self.table["modulus"] == name]
            if own["sigma_relative"].isna().all():
                continue
            lost = 100 * own["strain"].to_numpy()[~self.determined[self.table["modulus"] == name]]
            worst = own.loc[own["sigma_relative"].idxmax()]
            between = ledger.text(
                rf"{name} is not determined between {NUM} and {NUM} % of strain",
                [*lost[[0, -1]]] if len(lost) else [0, 0], digits=3, needed=False,
            )  # fmt: skip
            nowhere = ledger.text(rf"{name} is not determined at any strain", [], needed=False)
            seen = ledger.text(
                rf"{name} is uncertain by up to (\S+ %) \(1 sigma[^)]*\), "
                r"worst at (\S+) % of strain",
                [percent(worst["sigma_relative"]), 100 * worst["strain"]], digits=3, needed=False,
            )  # fmt: skip
            if (between or nowhere) != (len(lost) > 0) or nowhere != (len(lost) == len(own)):
                ledger.find(f"notes: {name}", f"is not determined at {len(lost)} strains")
            if seen != (worst["sigma_relative"] > 0.25 and not len(lost)):
                ledger.find(f"notes: {name}", f"uncertain by {worst['sigma_relative']:.3g}")

    # The terminal

    def terminal(self):
        """What the command printed: moduli, misfits, starts, how many notes."""
        ledger, result = self.ledger, self.result
        self._printed_moduli()
        ledger.text(rf"kN/m: times {NUM} mm", [self.card.thickness], source="terminal")
        ledger.text(r"95 % band, MPa", [], source="terminal")
        for name, misfit in result["misfit"].items():
            ledger.text(
                rf"^misfit of {name}: {NUM} {misfit['unit']} RMS, {NUM} times the noise "
                rf"\({NUM} {misfit['unit']}, {misfit['noise_is']}\)",
                [misfit["rms"], misfit["times_noise"], misfit["noise"]],
                digits=[3, 2, 3],
                source="terminal",
            )
        for source, moduli in result.get("pinned", {}).items():
            each = ", ".join(rf"{name} (\S+(?: %)?) \(at worst (\S+(?: %)?)\)" for name in moduli)
            words = [word for own in moduli.values() for word in told_of(own)]
            ledger.text(rf"^1 sigma from {source}: {each}", words, source="terminal")
        records = result["starts"]
        ends = [r["objective"] for r in records if r["objective"] is not None]
        ledger.text(
            rf"^(\d+) of (\d+) starts ended with a fit; .*: best {NUM}, median {NUM}; "
            r"(\d+) analyses(?: \((\d+) of \w+(?:, (\d+) from the cache)?\))?, \d+ s",
            [
                len(ends),
                len(records),
                result["objective"],
                float(np.median(ends)),
                result["analyses"],
                result["external_runs"],
                result["cached_runs"],
            ],
            digits=3,
            source="terminal",
        )
        lines = self.folder.terminal.splitlines()
        each = re.compile(r"(?:warning|note)(?:, (\d+) times \(notes\.csv has each\), as |: )(.*)")
        shown = [match for line in lines if (match := each.fullmatch(line))]
        kinds = dict(zip(result["warnings"], (n["kind"] for n in result["notes"]), strict=False))
        for match in shown:
            kind = kinds.get(match[2])
            if kind is None and match[0].startswith("warning"):
                ledger.find("terminal: warning", f"is {match[2]}")
            if match[1] and int(match[1]) != sum(own == kind for own in kinds.values()):
                ledger.find("terminal: warning", f"{match[0][:40]!r} of the kind {kind!r}")
        ledger.text(r"^(?:warning|note), (\d+) times \(notes\.csv", lambda m: [m[1]],
                    source="terminal", needed=False)  # fmt: skip
        count = len(result["warnings"]) - sum(int(match[1] or 1) for match in shown)
        ledger.text(r"^(\d+) further notes?:", [count], source="terminal", needed=count > 0)

    def _printed_moduli(self):
        """The table of moduli: strain, MPa, one sigma, band, kN/m."""
        row = re.compile(
            rf"^(?:(E1|E2|G12), \w+ \w+)?\s+{NUM} %\s+{NUM}\*?\s+({NUM} %|unknown|not known)"
            rf"\s+(?:{NUM}(\*?) to {NUM}(\*?)|not known)\s+{NUM}(  \(end\))?$"
        )
        name, count = None, {}
        for text in self.ledger.texts:
            match = row.match(text.text) if text.source == "terminal" else None
            if match is None:
                continue
            name = match[1] or name
            strains = [s for s in STRAINS if s < 0.95 * self.card.ends[name]]
            strains.append(self.card.ends[name])
            k = count[name] = count.get(name, -1) + 1
            own = self.table[self.table["modulus"] == name]
            value = float(self.card.modulus(name, strains[k]))
            sigma, lower, upper = (
                float(np.interp(strains[k], own["strain"], own[column]))
                for column in ("sigma_relative", "lower_MPa", "upper_MPa")
            )
            place = f"terminal: {name} at {strains[k]:.3g}"
            expected = (100 * strains[k], value, lower, upper, value * self.card.thickness)
            found = (match[2], match[3], match[6], match[8], match[10])
            for digits, number, right in zip((3, 4, 4, 4, 4), found, expected, strict=True):
                if number is not None:
                    self.ledger.compare_text(place, number, right, digits, 1e-5)
            known, *at_bounds = self.determined_at(name, strains[k])
            right = told(sigma, not known)
            if match[4] not in (right, "not known") and not _near(match[4], right):
                self.ledger.find(place, f"1 sigma is {match[4]}; expected {right}")
            if lower == lower and [bool(match[7]), bool(match[9])] != at_bounds:
                self.ledger.find(place, "marks the bounds wrongly")
            if bool(match[11]) != (k == len(strains) - 1):
                self.ledger.find(place, "marks the end wrongly")
            text.claim((0, len(text.text)), "consistent")

    def tests(self):
        for test, numbers in self.result["tests"].items():
            kind, section = self.kind_of(test)
            if kind in KINDS:
                KINDS[kind].audit(self, test, section, numbers)
            if not self.several:
                # Numbers of a single test also stand at the top.
                for key, own in numbers.items():
                    self.ledger.json(key, own, "consistent", rel=1e-12)


def _near(one, other):
    """Return whether two percentages differ by one of their last digits."""
    numbers = [as_number(text.removesuffix(" %")) for text in (one, other) if text[0].isdigit()]
    return len(numbers) == 2 and abs(numbers[0] - numbers[1]) <= 0.1 * max(numbers)


def _rows(band):
    """Return strain, lower and upper of the card's band, in whichever form it is written."""
    if isinstance(band, dict):
        return band["strain"], band["lower"], band["upper"]
    return band


def _banded(numbers, at_bounds):
    """Return the pattern of "364 (281* to 442)" with its numbers; whole from 99.5 on."""
    if not np.isfinite(numbers[1:]).all():
        return float(numbers[0])
    value, lower, upper = numbers
    on = (at_bounds[0] and value <= lower) or (at_bounds[1] and value >= upper)
    marks = [r"\*" * bool(at) for at in (on, *at_bounds)]
    pattern = r"(\S+?){} \((\S+?){} to (\S+?){}\)".format(*marks)
    return (pattern, *map(float, numbers))


def flags(column):
    """Return a column of True and False as such."""
    return column.astype(str).eq("True").to_numpy()


def told(sigma, lost):
    """Return a sigma as it is printed, where it is `lost` that it is not determined."""
    return "unknown" if lost or not sigma < LARGEST_SIGMA else percent(sigma)


def told_of(numbers):
    """Return the median and the largest sigma of what a test pins down, as printed."""
    share = numbers["not_determined"]
    return [told(numbers["median"], share > 0.5), told(numbers["largest"], share > 0.0)]


def _size(table):
    return float(np.abs(table["measured"].to_numpy(float)).max())


def _longest(strain, chosen):
    """Return the longest run of chosen strains; None where it is below a twentieth of all."""
    best, start = None, None
    for k, own in enumerate([*chosen, False]):
        if own and start is None:
            start = k
        elif not own and start is not None:
            run = float(strain[start]), float(strain[k - 1])
            if best is None or run[1] - run[0] > best[1] - best[0]:
                best = run
            start = None
    return list(best) if best and best[1] - best[0] > 0.05 * strain[-1] else None


def audit_biaxial(folder, ledger):
    """Audit a fit to biaxial tests alone, or the constants of such tests."""
    is_fit = "objective" in folder.result
    (audit_fit if is_fit else biaxial.audit_constants)(folder, ledger)


COMMANDS = dict.fromkeys(("bubble", "strips", "fit", "cycles", "tube"), audit_fit)
COMMANDS["biaxial"] = audit_biaxial
