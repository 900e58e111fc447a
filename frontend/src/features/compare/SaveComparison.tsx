import { Button, Group } from "@mantine/core";
import { useMutation } from "@tanstack/react-query";
import { comparisonFigure, curvesCsv } from "../../api/compare";
import { loadPlotly } from "../../charts/plotly";
import type { PlotlyFigure } from "../../charts/traces";
import { ErrorNotice } from "../../ui/ErrorNotice";

type Format = "png" | "svg";

const FORMATS: readonly Format[] = ["png", "svg"];
const SIZE = { width: 1280, height: 800 } as const;

/** Save the figure in the light theme on white, for documents. */
async function save(trials: readonly number[], filename: string, format: Format): Promise<void> {
  const { figure, reason } = await comparisonFigure(trials, "light");
  if (!figure) throw new Error(reason);
  const { data, layout } = figure as unknown as PlotlyFigure;
  const plotly = await loadPlotly();
  const onWhite = { ...layout, paper_bgcolor: "white", margin: { l: 70, r: 30, t: 30, b: 60 } };
  await plotly.downloadImage({ data, layout: onWhite }, { ...SIZE, format, filename, scale: format === "png" ? 2 : 1 });
}

/** Download of the curves as CSV and of the figure as an image. */
export function SaveComparison({ trials, stem }: { trials: readonly number[]; stem: string }) {
  const saving = useMutation({ mutationFn: (format: Format) => save(trials, stem, format) });
  return (
    <Group gap={8}>
      <Button
        component="a"
        variant="default"
        aria-label="Curves as CSV"
        href={curvesCsv(trials)}
        download={`${stem}.csv`}
      >
        CSV
      </Button>
      {FORMATS.map((format) => (
        <Button
          key={format}
          variant="default"
          aria-label={`Figure as ${format.toUpperCase()}`}
          loading={saving.isPending && saving.variables === format}
          onClick={() => saving.mutate(format)}
        >
          {format.toUpperCase()}
        </Button>
      ))}
      <ErrorNotice error={saving.error} />
    </Group>
  );
}
