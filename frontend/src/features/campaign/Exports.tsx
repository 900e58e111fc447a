import { Button, Group } from "@mantine/core";
import { pathOf, useDownload } from "../../api/files";
import type { Campaign } from "../../api/types";
import { ErrorNotice } from "../../ui/ErrorNotice";

/** Report and bundle of the campaign; no bundle during a flight. */
export function Exports({ campaign }: { campaign: Campaign }) {
  const pdf = useDownload(pathOf(campaign.id, "report.pdf"));
  const bundle = useDownload(pathOf(campaign.id, "bundle"));
  return (
    <>
      <Group gap={8} ms="auto">
        <Button
          component="a"
          variant="default"
          href={pathOf(campaign.id, "report.html")}
          target="_blank"
          rel="noreferrer"
        >
          Open report
        </Button>
        <Button variant="default" loading={pdf.isPending} onClick={() => pdf.mutate()}>
          PDF
        </Button>
        {campaign.flying === null && (
          <Button variant="default" loading={bundle.isPending} onClick={() => bundle.mutate()}>
            Export bundle
          </Button>
        )}
      </Group>
      <ErrorNotice error={pdf.error ?? bundle.error} />
    </>
  );
}
