import { SimpleGrid, Skeleton, Text, Title, useComputedColorScheme } from "@mantine/core";
import { useFailureShapes } from "../../api/logAnalyses";
import { FigurePanel } from "../../charts/FigurePanel";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import page from "../../ui/Page.module.css";
import { useTitle } from "../../ui/useTitle";
import { LibraryLink } from "./Loaded";

/** The atlas: what goes wrong in an altitude, what it looks like, how it is recognised, and what to do. */
export function FailureShapesPage() {
  useTitle("Failure shapes");
  const theme = useComputedColorScheme("light");
  const { data = [], error, isPending } = useFailureShapes();
  return (
    <div className={page["stack"]}>
      <div>
        <LibraryLink />
        <Title order={1}>Failure shapes</Title>
        <Note maw="90ch">Every log is searched for these. Each is drawn from a simulated flight.</Note>
      </div>
      <ErrorNotice error={error} />
      {isPending && <Skeleton height={420} radius="md" aria-busy="true" />}
      {data.map(({ code, title, recognised, advice, figures }) => (
        <SimpleGrid key={code} id={code} type="container" cols={{ base: 1, "860px": 2 }} spacing="var(--gap)">
          <div>
            <Title order={2} fz="var(--text-title)" mb={8}>
              {title}
            </Title>
            <Text lh={1.45} mb={8}>
              <b>Recognised:</b> {recognised}
            </Text>
            <Text lh={1.45}>
              <b>What to do:</b> {advice}
            </Text>
          </div>
          <FigurePanel title={title} card={figures[theme]} error={null} height={360} />
        </SimpleGrid>
      ))}
    </div>
  );
}
